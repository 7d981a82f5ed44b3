# ruff: noqa: E402
# %% [markdown]
# # Notebook: from frames to a contour
#
# From frames to contacts with covariance, and from these to a contour with corners and sides. Run
# the blocks in the order of the page, from the root of the repository (`. .ws/setup.sh`). The
# script is `docs/frames_to_contour.py`, in the percent format that Spyder, VS Code and Jupytext
# open as a notebook. The tests run it and compare its output.
#
# The frames are simulated with the same half-space that the estimator fits. So this page shows
# how the parts work together and how noise propagates, but not the accuracy on a real skin; for
# that see the [results](results_contact.md).
#
# ## A frame and its contact
#
# A ball presses with 2 N on an array of 16 × 16 tactels, 2 mm below the surface of the skin. The
# pressure is Boussinesq's.

# %%
import matplotlib.pyplot as plt
import numpy as np

from tactile_sensing import (
    ContactEstimator,
    EstimatorConfig,
    Layer,
    TactelArray,
    TactileImage,
)

array, depth, noise = TactelArray(16, 16, 1.6e-3, 1.6e-3), 2e-3, 630.0  # m, m, Pa
rng = np.random.default_rng(1)


def ball(x, y, force):
    """Image of a ball at a place [m] that presses with a force [N]."""
    away = np.hypot(array.x - x, array.y[:, None] - y)
    pressure = 1.5 / np.pi * force * depth**3 / (away**2 + depth**2)**2.5
    stress = pressure + rng.normal(0.0, noise, pressure.shape)
    return TactileImage(0, 0, (Layer('zz', depth, stress, noise_std=noise),), array, tared=True)


estimator = ContactEstimator(EstimatorConfig(tactel='point'))  # not the mean over tactels
contact = estimator.estimate(ball(1e-3, -2e-3, 2.0))
print(contact.type.name, f'at ({1e3 * contact.x:.1f}, {1e3 * contact.y:.1f}) mm,',
      f'{contact.normal_force:.1f} N')

# %% [markdown]
# ## What the covariance says
#
# The same press, fifty times at each of four places, with decreasing force. A 95 % ellipse should
# contain 95 % of the estimates or more: it includes possible unseen shear, and here there is
# none. Scatter and ellipses are drawn ten times as large as the scale of the pad.


# %%
def ellipse(contact, share=5.99):
    """Outline (60, 2) [m] of the 95 % ellipse of a point, about (0, 0)."""
    values, axes = np.linalg.eigh(contact.covariance[:2, :2])
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    return np.column_stack([np.cos(angle), np.sin(angle)]) * np.sqrt(share * values) @ axes.T


figure, axis = plt.subplots(figsize=(6, 5.4), layout='constrained')
inside = total = 0
for x, y, force in ((-6e-3, -6e-3, 4.0), (5e-3, -5e-3, 2.0), (6e-3, 5e-3, 1.0),
                    (-5e-3, 5e-3, 0.5)):
    estimates = [estimator.estimate(ball(x, y, force)) for _ in range(50)]
    contacts = [it for it in estimates if it.valid]
    off = np.array([(it.x - x, it.y - y) for it in contacts])
    inside += sum(it @ np.linalg.solve(c.covariance[:2, :2], it) < 5.99
                  for it, c in zip(off, contacts, strict=True))
    total += len(contacts)
    axis.plot(*(1e3 * (np.array([x, y]) + 10.0 * off)).T, '.', ms=4)
    for it in contacts:
        axis.plot(*(1e3 * (np.array([x, y]) + 10.0 * ellipse(it))).T, color='black', lw=0.3)
    axis.text(1e3 * x, 1e3 * y + 3.2, f'{force:g} N', ha='center')
axis.set(xlabel='x [mm]', ylabel='y [mm]', aspect='equal', xlim=(-12.7, 12.7), ylim=(-12.7, 12.7))
print(f'{100 * inside / total:.0f} % of {total} estimates lie in their ellipse')

# %% [markdown]
# ## A pad that follows an edge
#
# In simulation the servo follows two sides that meet. Each image is stored with its pose and its
# contact. The line is the fitted edge; its band is two standard deviations, drawn ten times as
# wide.

# %%
from tactile_servo import EdgeGoal
from tactile_simulation import load_scene, Simulation

simulation, seen = Simulation(load_scene('launch/scenes/two_segments.yaml'), seed=1), []


def keep(image):
    """Estimate the contact of an image as the simulation does, and keep all three."""
    seen.append((image, simulation.pose.copy(), simulation.estimator.estimate(image)))
    return seen[-1][2]


simulation.estimate = keep
status = simulation.run(EdgeGoal(speed=0.05, force=5.0), 20.0)
print(f'{status.reason.text}; {len(seen)} images')

lines = [it for it in seen if it[2].type.name == 'LINE' and it[2].valid]
corner = simulation.scene.edge.point_at(0.1)  # [m] along it
bend = min(seen, key=lambda it: np.linalg.norm(it[1][:2, 3] - corner[:2]))
figure, axes = plt.subplots(1, 3, figsize=(9, 3.2), layout='constrained')
for axis, (image, _, contact) in zip(
        axes, (lines[5], lines[len(lines) // 4], bend), strict=True):
    half_x, half_y = 1e3 * image.array.half_width_x, 1e3 * image.array.half_width_y
    axis.imshow(1e-3 * image.layers[0].stress, origin='lower', cmap='Greys',
                extent=(-half_x, half_x, -half_y, half_y))
    across = np.array([np.cos(contact.yaw), np.sin(contact.yaw)])
    along = np.linspace(-40.0, 40.0, 20) * 1e-3  # m from the point (x, y) of the edge
    points = np.array([[contact.x], [contact.y]]) + np.outer([-across[1], across[0]], along)
    covariance = contact.covariance
    wide = 20.0 * np.sqrt(np.trace(covariance[:2, :2]) - 2.0 * along * (across @ covariance[:2, 2])
                          + along**2 * covariance[2, 2])
    axis.plot(*(1e3 * points), color='#c05a00')
    sides = [1e3 * (points + side * np.outer(across, wide)) for side in (-1.0, 1.0)]
    axis.fill(*np.hstack([sides[0], sides[1][:, ::-1]]), color='#c05a00', alpha=0.3)
    axis.set(title=contact.type.name.lower(), xlabel='x [mm]', ylabel='y [mm]',
             xlim=(-half_x, half_x), ylim=(-half_y, half_y))

# %% [markdown]
# ## The contour
#
# Contacts and poses give points in space. Where the edge bends under the pad, the point is that of
# the image's ridge nearest to the pad's centre. Corners and sides are found in these points.

# %%
from tactile_shape import ContactPath, find_outline

path, points = ContactPath(), []
for image, pose, contact in seen:
    path.add_contact(image.stamp_ns, contact, None, image)
    points += [placed.contact.position for placed in path.add_pose(image.stamp_ns, pose)
               if placed.contact is not None]
outline = find_outline(np.array(points))
edge = simulation.scene.edge
lateral, _ = edge.nearest(outline.points)
print(str(outline).splitlines()[0])
print('turn', ', '.join(f'{np.degrees(it):.0f}' for it in outline.angles), 'degrees;',
      'within 0.1 mm of the true edge:', bool(abs(lateral).max() < 1e-4))

figure, axis = plt.subplots(figsize=(4, 5), layout='constrained')
axis.plot(*1e3 * edge.points[:, :2].T, color='#aab3b8', lw=5, label='true edge')
axis.plot(*1e3 * np.array(points)[:, :2].T, '.', ms=2, color='#0b6e99', label='contacts')
axis.plot(*1e3 * outline.points[:, :2].T, color='#c05a00', lw=1, label='outline')
axis.set(xlabel='x [mm]', ylabel='y [mm]', aspect='equal')
figure.legend(loc='outside right upper', fontsize=8)
