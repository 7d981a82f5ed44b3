"""
Generates pages from the code: parameters, troubleshooting, and the notebook with output.

`./ws docs` writes them; a test checks that they are up to date.
"""
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
import re

import yaml

from edge_tracking.parameters import NODES, parameters_of, SERVO
from tactile_sensing.types.contact import Reason
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.reasons import ReasonCode

FOLDER = Path(__file__).parent
# Usual cause and remedy by the names of the servo's and contacts' reasons, and of other problems.
REMEDIES = yaml.safe_load((FOLDER / 'remedies.yaml').read_text('utf-8'))
NOTEBOOK = FOLDER / 'frames_to_contour.py'
MADE = '<!-- Made by docs/generate.py: `./ws docs`. -->\n'
GROUPS = {0: 'Normal states', 100: 'Ends of a goal that was met', 200: 'Holds',
          300: 'Ends of a goal that was not met', 400: 'Refusals'}


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return the text of a Markdown table."""
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def parameters_page() -> str:
    """Return the page of all parameters, from the dataclasses in which the nodes declare them."""
    text = [MADE, """\
# Parameters

`ros2 run edge_tracking parameters > mine.yaml` writes a file with all parameters at their
defaults. Check it with `--check mine.yaml`, and give it to the launch with
`params_file:=mine.yaml` ([launching](launch.md)). Parameters marked *live* can be set while the
node runs; limits cannot. The values of the launch, for the PUMA 260, are in
`launch/config/edge_tracking.yaml`.
"""]
    for node in NODES:
        text += [f'## {node}\n', _parameters(parameters_of(node))]
        for law in LAWS if node == SERVO else ():
            shown = {(parameter.name, parameter.default) for parameter in parameters_of(node)}
            own = [parameter for parameter in parameters_of(node, law)
                   if (parameter.name, parameter.default) not in shown]
            same = [other for other in LAWS
                    if LAWS[other].law.config_type is LAWS[law].law.config_type]
            if law != DEFAULT and law == same[0]:
                text += [f'### {node} with law {" or ".join(same)}\n', 'In addition to those '
                         f'above, or with another default, except those only for the law '
                         f'`{DEFAULT}`:\n', _parameters(own)]
    return '\n'.join(text)


def _parameters(parameters) -> str:
    rows = []
    for name, default, _, data in parameters:
        low, high = data.get('range', (None, None))
        rows.append([
            f'`{name}`', f'`{_plain(default)}`', data.get('unit', ''),
            '' if low is None else f'{low:g} … {high:g}',
            ' '.join(data.get('doc', '').split()).replace('|', '\\|')
            + (' *(live)*' if data.get('live') else '')])
    return table(['name', 'default', 'unit', 'bounds', 'meaning'], rows)


def _plain(value) -> str:
    return str(list(value)) if isinstance(value, tuple) else repr(value)


def troubleshooting_page() -> str:
    """Return the page with cause and remedy of each reason."""
    text = [MADE, """\
# Troubleshooting

Every state, end and refusal of the servo has a code and a text: `reason_code` and `reason` in
`servo_status`, in the feedback and in the result. The text begins as in the second column; details
follow.

```sh
ros2 topic echo /tactile/servo_status --field reason
ros2 topic echo /diagnostics
```
"""]
    for first, title in GROUPS.items():
        rows = [[f'{code.value} `{code.name}`', code.text,
                 *REMEDIES['servo'].get(code.name, ('', 'nothing to do'))]
                for code in ReasonCode if first <= code < first + 100 and code.text]
        text += [f'## {title}\n', table(['code', 'text', 'usual cause', 'remedy'], rows)]
    rows = [[f'{reason.value} `{reason.name}`', *REMEDIES['contact'][reason.name]]
            for reason in Reason]
    text += ['## Contacts that are not valid\n',
             'Flags in `reasons` of `contact`; several can be set.\n',
             table(['flag', 'usual cause', 'remedy'], rows), '## Before anything moves\n',
             table(['what you see', 'usual cause', 'remedy'],
                   [[seen, *remedy] for seen, remedy in REMEDIES['machine'].items()])]
    return '\n'.join(text)


def notebook_page(save: bool = True) -> str:
    """
    Return the notebook with the output of its cells; `save` also writes their figures.

    It is a script in percent format, because a notebook file would need Jupyter to run.
    """
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    names: dict = {'__name__': 'notebook'}
    text, drawn = [MADE], 0
    for kind, cell in re.findall(r'^# %%( \[markdown\])?\n(.*?)(?=^# %%|\Z)',
                                 NOTEBOOK.read_text('utf-8'), re.M | re.S):
        cell = cell.strip()
        if kind:
            text.append(re.sub(r'^# ?', '', cell, flags=re.M) + '\n')
            continue
        printed = StringIO()
        with redirect_stdout(printed):
            exec(compile(cell, NOTEBOOK.name, 'exec'), names)
        text.append(f'```py\n{cell}\n```\n')
        if printed.getvalue():
            text.append(f'```text\n{printed.getvalue()}```\n')
        for number in pyplot.get_fignums():
            drawn += 1
            text.append(f'![Figure {drawn}](notebook_{drawn}.png)\n')
            if save:
                pyplot.figure(number).savefig(FOLDER / f'notebook_{drawn}.png', dpi=90)
        pyplot.close('all')
    return '\n'.join(text)


PAGES = {'parameters.md': parameters_page, 'troubleshooting.md': troubleshooting_page,
         'notebook.md': notebook_page}


def main() -> None:
    """Write the pages."""
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), 'utf-8')


if __name__ == '__main__':
    main()
