"""Tables in text files: as spreadsheets and NumPy write them, and what is none."""
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_table


@pytest.mark.parametrize('text', [
    '1,2.5,-3\n4,5,6\n7,8,9\n', 'a,b,c\n1,2.5,-3\n4,5,6\n7,8,9',
    '# saved\n1 2.5 -3\n4 5  6\n7 8 9\n',
    '1;2.5;-3\r\n4;5;6\r\n\r\n7;8;9\r\n', '1\t2.5\t-3\n4\t5\t6\n7\t8\t9\n',
    '\ufeff1,2.5,-3\n4,5,6\n7,8,9\n', '"x [V]",y,z\n1,2.5,-3e0\n4,5,6\n7,8,9\n',
    '0,1,2\n1,2.5,-3\n4,5,6\n7,8,9\n', 'x, y, z\n1;2.5;-3\n4;5;6\n7;8;9\n',
    '1;2,5;-3\n4;5;6\n7;8;9\n', '1\t2,5\t-3\n4\t5\t6\n7\t8\t9\n',
    '1,2.5,-3,\n4,5,6,\n7,8,9,\n', 'a,b,c\n1,2.5,-3,\n4,5,6,\n7,8,9,\n',
], ids=['plain', 'header', 'blanks', 'semicolons', 'tabs', 'byte order mark', 'quoted header',
        'column numbers', 'commas in the header', 'decimal commas', 'decimal commas and tabs',
        'commas at the end', 'commas at the end under a header'])
def test_ways_to_write_a_table(tmp_path, text):
    path = tmp_path / 't.csv'
    path.write_bytes(text.encode())
    table = read_table(path)
    assert table.shape == (3, 3) and table.dtype == np.float64
    np.testing.assert_array_equal(table, [[1, 2.5, -3], [4, 5, 6], [7, 8, 9]])


def test_numbers_survive_as_saved_and_integers_are_told_from_them(tmp_path):
    table = np.random.default_rng(0).normal(0.0, 1e-3, (5, 7))
    table[2, 3] = np.nan
    np.savetxt(tmp_path / 't.csv', table, delimiter=',')
    np.testing.assert_array_equal(read_table(tmp_path / 't.csv'), table)
    path = tmp_path / 't.csv'
    path.write_text('1,-2\n3,4\n')
    assert read_table(path).dtype == np.int64
    path.write_text('1,-2\n3,4.0\n')
    assert read_table(path).dtype == np.float64


@pytest.mark.parametrize('data, words', [
    (b'', 'holds no row of numbers'), (b'a,b\n', 'holds no row of numbers'),
    (b'a,b\nc,d\n1,2\n', "could not convert string 'c'"),
    (b'1,2\n3\n', 'the number of columns changed from 2 to 1 at row 2'),
    (b'1,2\n3,\n', "could not convert string ''"),
    (b'1,2\n3,x\n', "could not convert string 'x' to float64 at row 1, column 2"),
    (b'\x00\xff\n\x01\n', 'could not convert'),
])
def test_what_is_no_table_is_named(tmp_path, data, words):
    path = tmp_path / 't.csv'
    path.write_bytes(data)
    with pytest.raises(ConfigurationError) as error:
        read_table(path)
    assert words in str(error.value) and str(error.value).startswith(f'{path}: ')


def test_a_large_table_is_refused_before_it_is_read_and_no_file_is_named(tmp_path):
    with open(tmp_path / 't.csv', 'wb') as file:
        file.truncate(80_000_000)
    with pytest.raises(ConfigurationError, match='save it as .npy.* would take 80 MB'):
        read_table(tmp_path / 't.csv')
    with pytest.raises(ConfigurationError, match=r'gone.csv: cannot be read: No such file'):
        read_table(tmp_path / 'gone.csv')
