"""Whatever is wrong with the kernel cache costs time: never an answer, an exit code or a signal."""

import errno
import json
import os
import pickle
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from numba import config

from commands import FEW_KERNELS
from terrapath._kernels import cache
from terrapath._kernels.compiler import cache_statistics, kernel
from terrapath.errors import KernelWarning


def halved(x, n):
    return 0.5 * x + n


def doubled(x, n):
    return 2.0 * x + n


def answers(function=halved, n=1):
    """What a process finds that has the kernel not in memory: the value, and what it compiled."""
    before = cache_statistics()["compiled"]
    return kernel(function)(3.0, n), cache_statistics()["compiled"] - before


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The cache, with one kernel in it."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_failures", [])
    cache.directory.cache_clear()
    assert answers() == (2.5, 1)
    assert answers() == (2.5, 0)
    yield cache.directory()
    cache.directory.cache_clear()


@pytest.fixture
def kept(folder):
    """The file of the kernel."""
    (file,) = folder.iterdir()
    return file


# Files


def cut_to(share):
    return lambda file: os.truncate(file, int(share * file.stat().st_size))


def cut_by(count):
    return lambda file: os.truncate(file, file.stat().st_size - count)


def flip(share, bit=0):
    """Flip one bit."""

    def damage(file):
        content = bytearray(file.read_bytes())
        content[int(share * (len(content) - 1))] ^= 1 << bit
        file.write_bytes(content)

    return damage


def fill(content):
    return lambda file: file.write_bytes(content)


def zero_a_block(file):
    content = bytearray(file.read_bytes())
    content[512:1024] = bytes(512)
    file.write_bytes(content)


def swap_two_blocks(file):
    content = file.read_bytes()
    file.write_bytes(content[:512] + content[1024:1536] + content[512:1024] + content[1536:])


def append(file):
    file.write_bytes(file.read_bytes() + b"\0")


def twice(file):
    file.write_bytes(file.read_bytes() * 2)


def checked(content):
    """With a checksum that is right, around what is not."""
    return lambda file: file.write_bytes(cache._checksum(file, content) + content)


def other_types(file):
    _, reduced = pickle.loads(cache.read_sound(file))
    checked(pickle.dumps(((), reduced)))(file)


def other_kernel(file):
    """In its place lies the sound file of another."""
    file.unlink()
    answers(doubled)
    (other,) = file.parent.iterdir()
    other.rename(file)


def replace_by(make):
    def damage(file):
        file.unlink()
        make(file)

    return damage


def link_to(target):
    return replace_by(lambda file: file.symlink_to(target))


def sparse(file):
    os.truncate(file, 10**7)


def no_folder(file):
    shutil.rmtree(file.parent)


def no_cache_at_all(file):
    shutil.rmtree(file.parents[1])


garbage = np.random.default_rng(1).bytes(5_000)

REPAIRED = {
    "emptied": cut_to(0),
    "one byte": lambda file: os.truncate(file, 1),
    "half a checksum": lambda file: os.truncate(file, 16),
    "a checksum and nothing else": lambda file: os.truncate(file, 32),
    "a checksum and a byte": lambda file: os.truncate(file, 33),
    **{f"cut to {share}": cut_to(share) for share in (0.1, 0.5, 0.9)},
    "one byte lost": cut_by(1),
    **{f"a bit flipped at {share}": flip(share) for share in (0.0, 0.002, 0.1, 0.3, 0.5, 0.7, 1.0)},
    **{f"bit {bit} flipped in the middle": flip(0.45, bit) for bit in (1, 4, 7)},
    "a block of zeros": zero_a_block,
    "two blocks swapped": swap_two_blocks,
    "a byte more": append,
    "written twice": twice,
    "zeros": fill(bytes(5_000)),
    "ones": fill(b"\xff" * 5_000),
    "garbage": fill(garbage),
    "text": fill(b"<html>404 Not Found</html>"),
    "a pickle": fill(pickle.dumps({"key": "name"})),
    "checked, but nothing": checked(b""),
    "checked, but garbage": checked(garbage),
    "checked, but a pickle of something else": checked(pickle.dumps(["no", "kernel", "here"])),
    "checked, but a pickle of a name that is not there": checked(b"cterrapath\nnowhere\n."),
    "checked, but cut": checked(pickle.dumps(list(range(100)))[:-20]),
    "of other types": other_types,
    "of another kernel": other_kernel,
    "a folder in its place": replace_by(Path.mkdir),
    "a link to nowhere": link_to("nowhere"),
    "a link to itself": lambda file: link_to(file.name)(file),
    "a link to a device": link_to("/dev/zero"),
    "megabytes of nothing": sparse,
    "no file": Path.unlink,
    "no folder": no_folder,
    "no cache at all": no_cache_at_all,
}
if hasattr(os, "mkfifo"):
    REPAIRED["a pipe in its place"] = replace_by(os.mkfifo)


@pytest.mark.parametrize("damage", REPAIRED.values(), ids=REPAIRED)
def test_a_damaged_file_is_compiled_anew_and_replaced(damage, kept):
    damage(kept)
    assert cache.read_sound(kept) is None or damage in CHECKED
    assert answers() == (2.5, 1)  # and no warning, which would be an error
    assert cache.read_sound(kept) is not None
    assert answers() == (2.5, 0)


CHECKED = [make for name, make in REPAIRED.items() if "checked" in name or "other types" in name]


def test_a_file_that_is_sound_is_not_written_again(kept):
    before = kept.stat().st_mtime_ns
    assert answers() == (2.5, 0)
    assert kept.stat().st_mtime_ns == before


def test_each_kernel_and_each_type_has_a_file_of_its_own(folder):
    assert answers(n=1.5) == (3.0, 1)
    assert answers(doubled) == (7.0, 1)
    assert len(list(folder.iterdir())) == 3
    assert answers() == (2.5, 0)
    assert cache.kept_files() == sorted(file.name for file in folder.iterdir())


def test_what_is_damaged_or_of_another_compiler_is_not_counted_as_kept(kept, monkeypatch):
    assert cache.kept_files() == [kept.name]
    append(kept)
    assert cache.kept_files() == []
    answers()
    assert cache.kept_files() == [kept.name]
    monkeypatch.setattr(cache, "environment", lambda: "another")
    assert cache.kept_files() == []
    assert answers() == (2.5, 1)


def test_a_kernel_that_stands_in_no_file_is_not_kept(folder):
    scope = {}
    exec("def typed_in(x, n):\n    return x - n\n", scope)
    for _ in range(2):
        assert answers(scope["typed_in"]) == (2.0, 1)
    assert len(list(folder.iterdir())) == 1


def test_kernels_of_one_factory_differ_by_what_they_close_over(folder):
    def adding(constant):
        def added(x, n):
            return x + n + constant

        return added

    assert [answers(adding(c)) for c in (1.0, 2.0)] == [(5.0, 1), (6.0, 1)]
    assert [answers(adding(c)) for c in (1.0, 2.0)] == [(5.0, 0), (6.0, 0)]


# What cannot be written or read


def fail_with(number):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    return fail


def failing(owner, name, number):
    return lambda patch, folder: patch.setattr(owner, name, fail_with(number))


def file_for_a_folder(patch, folder):
    shutil.rmtree(folder)
    folder.write_text("not a folder")


def file_for_the_cache(patch, folder):
    shutil.rmtree(folder.parent)
    folder.parent.write_text("not a folder")


def full_folder_in_its_place(patch, folder):
    (file,) = folder.iterdir()
    file.unlink()
    (file / "inside").mkdir(parents=True)


def no_large_files(patch, folder):
    """No simulation: the system itself refuses more than so many bytes."""
    resource = pytest.importorskip("resource")
    limit_files(resource, 1_000)


def limit_files(resource, size):
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))


@pytest.fixture
def file_limit():
    """Put back what a test changed."""
    resource = pytest.importorskip("resource")
    before, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield
    limit_files(resource, before)


UNKEPT = {
    "a full disk": failing(Path, "write_bytes", errno.ENOSPC),
    "a quota": failing(Path, "write_bytes", errno.EDQUOT),
    "a broken disk": failing(Path, "write_bytes", errno.EIO),
    "a read-only disk": failing(Path, "write_bytes", errno.EROFS),
    "somebody else's folder": failing(Path, "write_bytes", errno.EACCES),
    "too many open files": failing(Path, "write_bytes", errno.EMFILE),
    "no folder can be made": failing(Path, "mkdir", errno.EACCES),
    "a name that is taken meanwhile": failing(Path, "replace", errno.EBUSY),
    "a file for a folder": file_for_a_folder,
    "a file for the cache": file_for_the_cache,
    "a folder in its place that is in use": full_folder_in_its_place,
    "files may not be large": no_large_files,
}


@pytest.mark.parametrize("spoil", UNKEPT.values(), ids=UNKEPT)
def test_where_kernels_cannot_be_kept_there_are_answers_and_one_warning(
    spoil, folder, monkeypatch, file_limit
):
    with monkeypatch.context() as patch, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        spoil(patch, folder)
        found = [answers(function)[0] for function in (halved, doubled, doubled)]
    assert found == [2.5, 7.0, 7.0]
    (warning,) = told
    assert issubclass(warning.category, KernelWarning)
    assert f"kernels cannot be kept in {folder}: " in str(warning.message)
    assert "NUMBA_CACHE_DIR" in str(warning.message)
    assert cache.unkept() == str(warning.message)
    assert not list(folder.glob(".terrapath-*")) or not folder.is_dir()


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.ESTALE, errno.ENOMEM])
def test_what_cannot_be_read_is_compiled(number, kept, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", fail_with(number))
        assert cache.read_sound(kept) is None
        assert cache.kept_files() == []
    monkeypatch.setattr(cache, "read_sound", lambda path: None)
    assert answers() == (2.5, 1)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is forbidden to root"
)
@pytest.mark.parametrize("mode", [0o000, 0o200, 0o444])
def test_permissions_cost_time_alone(mode, kept):
    kept.chmod(mode)
    assert answers()[0] == 2.5
    kept.parent.chmod(0o555)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KernelWarning)
            assert answers(doubled)[0] == 7.0
    finally:
        kept.parent.chmod(0o755)


def test_without_a_place_to_write_to_there_is_still_one_to_name(monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr("numba.core.caching.CacheImpl._locator_classes", [])
    cache.directory.cache_clear()
    try:
        assert cache.directory() == Path(cache.__file__).parent / "__pycache__"
    finally:
        cache.directory.cache_clear()


# The command


def plan(folder, *arguments):
    """A plan in a process of its own, with its kernels in a folder: exit code, record, remarks."""
    command = [sys.executable, "-c", "from terrapath.cli import main; main()"]
    done = subprocess.run(
        [*command, *FEW_KERNELS, "--json", *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    record = json.loads(done.stdout) if done.stdout else {}
    return done.returncode, record.get("path"), done.stderr.splitlines()


@pytest.mark.slow
def test_a_plan_on_a_cache_that_is_all_damaged(tmp_path):
    code, path, told = plan(tmp_path)
    assert (code, told) == (0, [])
    files = sorted(tmp_path.rglob("*.nbc"))
    # Another kernel's file is made in a folder of its own; here there are many. It is tested alone.
    left_out = ("no cache at all", "of another kernel")
    assert REPAIRED.keys() >= set(left_out)
    damages = [damage for name, damage in REPAIRED.items() if name not in left_out]
    for file, damage in zip(files, damages[:: len(damages) // len(files)], strict=False):
        damage(file)
    assert plan(tmp_path) == (0, path, [])
    assert all(cache.read_sound(file) is not None for file in files)


@pytest.mark.slow
def test_a_plan_on_a_full_disk(tmp_path):
    """The disk is a small one in memory, where this user may make one."""
    disk, out = tmp_path / "disk", tmp_path / "route.geojson"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.call(mount):
        pytest.skip("no disk can be mounted here")
    try:
        code, path, told = plan(disk, "--output", str(out))
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    assert code == 0
    assert path
    assert out.exists()
    (line,) = told
    assert f"kernels cannot be kept in {disk}" in line
    assert "No space left on device" in line
    assert "NUMBA_CACHE_DIR" in line


def test_what_editors_leave_beside_kernels_is_no_kernel(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "one.py").write_text("x = 1\n")
    before = cache.package_stamp(tmp_path)
    (tmp_path / "sub" / ".#one.py").symlink_to("nowhere")
    (tmp_path / "folder.py").mkdir()
    assert cache.package_stamp(tmp_path) == before
    (tmp_path / "sub" / "two.py").write_text("")
    assert cache.package_stamp(tmp_path) != before
