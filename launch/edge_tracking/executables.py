"""Executables of the package; their modules are imported after the signal handlers are set."""
from tactile_common.start import executable

composed = executable('edge_tracking.composed', interrupted=0)
demo = executable('edge_tracking.demo')
parameters = executable('edge_tracking.parameters')
play_bag = executable('edge_tracking.replay.play_bag')
record_bag = executable('edge_tracking.recording.record_bag')
report = executable('edge_tracking.report.page')
replay = executable('edge_tracking.replay.command')
track = executable('edge_tracking.track')
view = executable('edge_tracking.view', interrupted=0)
