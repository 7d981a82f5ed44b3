"""Small files that would fill the memory: each is refused in one line before it is expanded."""
import json
from pathlib import Path
import struct
import subprocess
import sys
import zipfile

import numpy as np
from numpy.lib import format as npy
import pytest

rosbag2 = pytest.importorskip('rosbags.rosbag2')
MEMORY = 200 << 20  # bytes on top of what the imports take

# Reads the files, each with its reader, under a limit on the memory; one line for each.
PROGRAM = """
import json, resource, sys
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import ArrayReader
from tactile_common.ros.bag_reader import Bag
from tactile_sensing.devices.calibration import load_calibration
from tactile_sensing.devices.recording import load_recording
from tactile_shape.contact_recording import load_contacts
from tactile_simulation.scene import load_scene

def read_bag(path):
    with Bag(path) as bag:
        for row in bag.messages(bag.topics):
            row.message

READERS = {'scene': load_scene, 'calibration': load_calibration, 'recording': load_recording,
           'frames': lambda path: ArrayReader(path, 'frames').chunks(1), 'contacts': load_contacts,
           'bag': read_bag}
pages = int(open('/proc/self/statm').read().split()[0])
most = pages * resource.getpagesize() + int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (most, most))
for reader, path in json.loads(sys.argv[2]):
    try:
        READERS[reader](path)
        print('it was read')
    except ConfigurationError as error:
        print(error)
"""


def refusals(cases):
    """Messages of readers about paths."""
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, str(MEMORY), json.dumps(cases, default=str)],
        capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout.splitlines()


def saved(folder, name, data):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


ALIASES = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{b}: &{b} [{", ".join([f"*{a}"] * 9)}]\n'
    for a, b in zip('abcdefgh', 'bcdefghi', strict=True))
YAML = {
    'aliases': (ALIASES, 'line 2: alias *a: aliases are refused'),
    'nested': ('[' * 300_000, 'more than 32 lists or mappings in each other'),
    'many': ('- 1\n' * 200_000, 'more than 70000 values'),
    'long': ('- 1\n' * 10_000_000, 'has more than 1048576 bytes'),
    'digits': ('a: ' + '9' * 9000, 'is not YAML'),
}


def test_yaml(tmp_path):
    cases, words = [], []
    for name, (text, word) in YAML.items():
        path = saved(tmp_path, f'{name}.yaml', text)
        cases += [('scene', path), ('calibration', path)]
        words += [word, word]
    for line, (reader, path), word in zip(refusals(cases), cases, words, strict=True):
        assert line.startswith(f'{reader} {path}: ') and word in line and len(line) < 500


EDGES = {
    'arcs': ('start: [0, 0, 0], heading: 0, path: [' + '{arc: {radius: 10, angle: 360}}, ' * 9000
             + ']', 'm long, must be above 0 and at most 20 m'),
    'straights': ('start: [0, 0, 0], heading: 0, path: [' + '{straight: 10}, ' * 9000 + ']',
                  'm long, must be above 0 and at most 20 m'),
    'wave': ('start: [0, 0, 0], heading: 0, path: [{straight: 10}], '
             'wave: {height: 0.001, length: 0.001}', 'edge.wave.length'),
}


def test_scenes_that_are_small_but_long(tmp_path):
    cases = [('scene', saved(tmp_path, f'{name}.yaml',
                             f'name: a\ndescription: b\nedge: {{{text}}}\n'))
             for name, (text, _) in EDGES.items()]
    for line, (_, word) in zip(refusals(cases), EDGES.values(), strict=True):
        assert word in line and len(line) < 500


def bomb(folder, file, name, shape, dtype='<f8', version=1):
    """Write an archive with an array of zeros that is a thousandth of what it holds."""
    path = folder / f'{file}.npz'
    header = {'descr': dtype, 'fortran_order': False, 'shape': shape}
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for array in ('position', 'normal', name):
            with archive.open(f'{array}.npy', 'w', force_zip64=True) as member:
                if version == 2 and array == name:  # a header that claims to have 1.5 GB
                    member.write(npy.magic(2, 0) + struct.pack('<I', 1_500_000_000))
                elif array == name:
                    npy.write_array_header_1_0(member, header)
                else:
                    npy.write_array(member, np.zeros(3))
                    continue
                size = int(np.prod(shape)) * np.dtype(dtype).itemsize
                for _ in range(size >> 20):
                    member.write(bytes(1 << 20))
                member.write(bytes(size % (1 << 20)))
    return path


def test_archives(tmp_path):
    large = bomb(tmp_path, 'large', 't', (6_000, 32, 64))  # 98 MB
    row = bomb(tmp_path, 'row', 'frames', (2, 2_000_000))
    head = bomb(tmp_path, 'head', 'frames', (300_000_000,), '<u1', version=2)
    assert large.stat().st_size < 500_000
    with zipfile.ZipFile(tmp_path / 'method.npz', 'w', zipfile.ZIP_LZMA) as archive:
        archive.writestr('frames.npy', b'\x93NUMPY')
        archive.writestr('rate_hz.npy', b'\x93NUMPY')
    with zipfile.ZipFile(tmp_path / 'rate.npz', 'w', zipfile.ZIP_DEFLATED) as archive:
        for name in ('frames', 'rate_hz'):
            archive.writestr(f'{name}.npy', b'\x93NUMPY\x01\x00' + b'\xff\xff' + bytes(65535))
    with open(tmp_path / 'row.npy', 'wb') as plain:
        npy.write_array_header_1_0(
            plain, {'descr': '<f8', 'fortran_order': False, 'shape': (2, 8_000_000)})
        plain.truncate(plain.tell() + 2 * 8 * 8_000_000)
    cases = [
        ('frames', row, 'a row of frames', '16 MB, at most 4 MB'),
        ('frames', tmp_path / 'row.npy', 'a row of frames', '64 MB, at most 4 MB'),
        ('frames', head, 'is not an .npz archive of numbers', ''),
        ('recording', tmp_path / 'method.npz', 'compressed in a way that NumPy does not', ''),
        ('recording', tmp_path / 'rate.npz', 'is not an .npz archive of numbers', ''),
        ('contacts', large, 't (6000, 32, 64)', 'at most 67 MB are read'),
    ]
    lines = refusals([case[:2] for case in cases])
    for line, (_, path, *words) in zip(lines, cases, strict=True):
        assert str(path) in line and all(word in line for word in words), line
        assert len(line) < 500


def recorded(folder, name, definition, data=b'\x00\x01\x00\x00'):
    """Write a bag of one message of a type of its own."""
    with rosbag2.Writer(folder / name, version=9,
                        storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            '/x', f'mad_msgs/msg/{name.title()}', msgdef=definition, rihs01=f'RIHS01_{64 * "0"}')
        writer.write(connection, 0, data)
    return folder / name


NESTED = 'mad_msgs/A1[90] a\n' + ''.join(
    f'{"=" * 80}\nMSG: mad_msgs/A{k}\nmad_msgs/A{k + 1}[90] a\n' for k in range(1, 6)) + (
    f'{"=" * 80}\nMSG: mad_msgs/A6\nfloat64 x\n')


def chunked(folder, name, claimed, size):
    """Write a bag whose messages are in a chunk of zstd that holds more than it says."""
    path = recorded(folder, name, 'float64 x')
    (file,) = path.glob('*.mcap')
    from rosbags.rosbag2 import storage_mcap
    packed = storage_mcap.zstd.compress(bytes(size))
    chunk = (struct.pack('<QQQI', 0, 0, claimed, 0) + struct.pack('<I', 4) + b'zstd'
             + struct.pack('<Q', len(packed)) + packed)
    whole = file.read_bytes()
    # In front of all other records; without summary, so that the file is scanned.
    begin = 8 + 9 + struct.unpack('<Q', whole[9:17])[0]
    footer = b'\x02' + struct.pack('<Q', 20) + struct.pack('<QQI', 0, 0, 0) + whole[-8:]
    file.write_bytes(whole[:begin] + b'\x06' + struct.pack('<Q', len(chunk)) + chunk + footer)
    return path


def test_bags(tmp_path):
    meta = recorded(tmp_path, 'meta', 'float64 x')
    (meta / 'metadata.yaml').write_text(ALIASES)
    cases = {
        recorded(tmp_path, 'strings', 'string[1000000] names'):
            'names of mad_msgs/msg/Strings is an array of fixed length, only read of numbers',
        recorded(tmp_path, 'nested', NESTED): 'is an array of fixed length',
        recorded(tmp_path, 'empty', f'mad_msgs/A[] a\n{"=" * 80}\nMSG: mad_msgs/A\n'):
            'mad_msgs/msg/A has no field',
        recorded(tmp_path, 'long', f'# {"x" * 200_000}\nfloat64 x'): 'at most 131072',
        recorded(tmp_path, 'loop', 'mad_msgs/Loop[] again'): 'maximum recursion depth',
        recorded(tmp_path, 'bounded', 'string<=1000000[<=1000000] names',
                 b'\x00\x01\x00\x00\xff\xff\xff\x7f'): 'is damaged',
        meta: 'aliases are refused',
        chunked(tmp_path, 'chunk', 1 << 40, 1000): 'a chunk of 1099512 MB',
        chunked(tmp_path, 'liar', 1000, 2_000_000_000): 'is not a rosbag2 recording',
    }
    lines = refusals([('bag', path) for path in cases])
    for line, (path, word) in zip(lines, cases.items(), strict=True):
        assert line.startswith(f'bag {path}: ') and word in line, line
        assert len(line) < 500


def test_what_is_of_a_usual_size_is_read(tmp_path):
    frames = np.arange(2000 * 16 * 16, dtype=np.float32).reshape(2000, 16, 16)
    path = tmp_path / 'usual.npz'
    np.savez_compressed(path, frames=frames, rate_hz=200.0)
    gains = tmp_path / 'gains.yaml'
    gains.write_text('rows: 100\ncolumns: 100\npitch: 0.001\ngain:\n' + ''.join(
        f'- [{", ".join(["627.45"] * 100)}]\n' for _ in range(100)))
    scenes = sorted((Path(__file__).parents[1] / 'launch' / 'scenes').glob('*.yaml'))
    cases = [('recording', path), ('frames', path), ('calibration', gains),
             *(('scene', scene) for scene in scenes),
             ('bag', recorded(tmp_path, 'usual', 'float64[36] covariance\nstring[] names',
                              b'\x00\x01\x00\x00' + bytes(8 * 36 + 4)))]
    assert set(refusals(cases)) == {'it was read'}
