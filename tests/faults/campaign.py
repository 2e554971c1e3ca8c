"""Faults of all kinds against builds. After each, the same command must either finish with the
files of an undisturbed build, or fail with a message; a command that succeeds with other files is a
silent loss.

    python3 tests/faults/campaign.py target/release/splitsnow [--share 1] [--seed 1]

Needs Linux and root (mounts of small file systems) and faketime. `--share` is the share of the
random faults to try. Prints a line per fault kind; ends with 1 if anything was lost silently.
"""

import argparse
import contextlib
import filecmp
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# 24 jobs, small enough to build a thousand times
GRID = """version = 1
[axes]
facetness = [0.1, 0.5, 0.9]
grain_size_um = [300, 500]
density_kg_m3 = [100, 200]
thickness_cm = [1, 2]
incidence_angle_deg = [0, 60]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 20
[run]
engine = "spectral"
rays = 500
"""
# with tables of grain events, which the processes share
TABLES = GRID.replace("spectral", "tabulated")
# long enough to be killed in the middle of a job
SLOW = GRID.replace("rays = 500", "rays = 20000")
# not part of the result
TRANSIENT = (".splitsnow-", "lost+found")


class Trial:
    """A folder with a grid file and an output directory."""

    def __init__(self, program, folder, grid, expected=None):
        self.program, self.folder, self.expected = program, Path(folder), expected
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / "g.toml").write_text(grid)
        self.out = self.folder / "out" / "g"

    def command(self, *words):
        return [self.program, *words]

    def run(self, *words, prefix=()):
        return subprocess.run(
            [*prefix, *self.command(*words)], cwd=self.folder, capture_output=True, text=True, timeout=300
        )

    def build(self, *words, prefix=()):
        return self.run("build", "g.toml", *words, prefix=prefix)

    def start(self, *words):
        return subprocess.Popen(
            self.command("build", "g.toml", *words),
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def is_whole(self):
        return same(self.out, self.expected)


def files(root):
    found = {}
    for path in root.rglob("*"):
        name = path.relative_to(root)
        if path.is_file() and not name.parts[0].startswith(TRANSIENT):
            found[name] = path
    return found


def same(root, expected):
    """Whether the results in two output directories are equal to the byte."""
    own, other = files(root), files(expected)
    return own.keys() == other.keys() and all(
        filecmp.cmp(own[name], other[name], shallow=False) for name in own
    )


class Counts:
    """What came of the faults of one kind."""

    def __init__(self, kind):
        self.kind, self.tried, self.repaired, self.refused, self.lost = kind, 0, 0, 0, []

    def judge(self, trial, result, what):
        """`result` is that of the last build."""
        self.tried += 1
        if result.returncode:
            clear = result.stderr.startswith("error: ") and "panicked" not in result.stderr
            self.refused += clear
            if not clear:
                self.lost.append(f"{what}: {result.returncode} {result.stderr}")
        elif trial.is_whole():
            self.repaired += 1
        else:
            self.lost.append(what)

    def line(self):
        return f"| {self.kind} | {self.tried} | {self.repaired} | {self.refused} | {len(self.lost)} |"


def kills(program, folder, expected, rng, number):
    """SIGKILL at random moments, to single builds and to one of three shards."""
    counts = Counts("`kill -9` of single builds and shards")
    killed = round_ = 0
    while killed < number:
        round_ += 1
        trial = Trial(program, folder / f"kill{round_}", SLOW, expected)
        for _ in range(rng.randrange(2, 8)):
            shards = rng.random() < 0.5
            words = [["--shard", f"{i}/3", "--threads", "1"] for i in range(3)] if shards else [[]]
            processes = [trial.start(*word) for word in words]
            time.sleep(rng.uniform(0.0, 1.5))
            victim = rng.choice(processes)
            if victim.poll() is None:
                victim.kill()
                killed += 1
            if shards and rng.random() < 0.5:
                for process in processes:
                    process.kill()
            for process in processes:
                process.wait()
        counts.judge(trial, trial.build(), f"round {round_}")
        shutil.rmtree(trial.folder)
    counts.tried = killed
    counts.repaired = killed - len(counts.lost)
    return counts


def damage(program, folder, expected, expected_tables, rng, number):
    """Flipped bits and truncations of every kind of file, in finished and in unfinished builds."""
    counts = Counts("flipped bits and truncations of all kinds of files")
    finished = Trial(program, folder / "finished", GRID, expected)
    assert finished.build().returncode == 0
    unfinished = Trial(program, folder / "unfinished", GRID, expected)
    for shard in ("0/3", "2/3"):
        assert unfinished.build("--shard", shard).returncode == 0
    partial = unfinished.start("--shard", "1/3", "--threads", "1")
    time.sleep(0.05)
    partial.kill()
    partial.wait()
    tables = Trial(program, folder / "tables", TABLES, expected_tables)
    assert tables.build("--shard", "1/3").returncode == 0
    assert list(tables.out.glob(".splitsnow-tables/*"))
    for number_ in range(number):
        base = rng.choice([finished, unfinished, tables])
        grid = TABLES if base is tables else GRID
        trial = Trial(program, folder / "damaged", grid, base.expected)
        shutil.copytree(base.out, trial.out, symlinks=True)
        victims = [path for path in sorted(trial.out.rglob("*")) if path.is_file() and path.stat().st_size]
        # all kinds are as likely, however many files there are of each
        kinds = sorted({str(path.parent) for path in victims})
        kind = rng.choice(kinds)
        path = rng.choice([path for path in victims if str(path.parent) == kind])
        content = bytearray(path.read_bytes())
        if rng.random() < 0.7:
            place = rng.randrange(len(content))
            content[place] ^= 1 << rng.randrange(8)
            what = f"{path.relative_to(trial.out)} byte {place}"
        else:
            content = content[: rng.randrange(len(content))]
            what = f"{path.relative_to(trial.out)} cut to {len(content)}"
        path.write_bytes(content)
        counts.judge(trial, trial.build(), what)
        shutil.rmtree(trial.folder)
    return counts


def mounted(folder, options):
    folder.mkdir(parents=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "splitsnow", folder], check=True)


def full_disk(program, folder, expected):
    """A disk that fills up while a build runs, with room for so many more blocks; then there is
    more."""
    counts = Counts("disk full after 0 to 39 more blocks")
    for room in range(40):
        trial = Trial(program, folder / f"full{room}", SLOW, expected)
        disk = trial.folder / "out"
        mounted(disk, "size=2m")
        process = trial.start("--threads", "1")
        while not (trial.out / "database.zarr").exists():
            time.sleep(0.001)
        space = os.statvfs(disk)
        # the build takes blocks meanwhile, so the last of these may not fit
        with contextlib.suppress(OSError), open(disk / "filler", "wb", buffering=0) as filler:
            for _ in range(space.f_bavail - room):
                filler.write(bytes(space.f_frsize))
        process.wait()
        subprocess.run(["mount", "-o", "remount,size=100m", disk], check=True)
        counts.judge(trial, trial.build(), f"{room} blocks")
        subprocess.run(["umount", disk], check=True)
        shutil.rmtree(trial.folder)
    return counts


def full_inodes(program, folder, expected):
    """A file system with room for so many more files; then there is more."""
    counts = Counts("no more inodes, at every file in turn")
    room = 2
    while True:
        trial = Trial(program, folder / f"full{room}", GRID, expected)
        disk = trial.folder / "out"
        mounted(disk, f"nr_inodes={room}")
        first = trial.build()
        if first.returncode and not first.stderr.startswith("error: "):
            counts.lost.append(f"{room} inodes: {first.stderr}")
        subprocess.run(["mount", "-o", "remount,nr_inodes=100000", disk], check=True)
        counts.judge(trial, trial.build(), f"{room} inodes")
        subprocess.run(["umount", disk], check=True)
        shutil.rmtree(trial.folder)
        if first.returncode == 0:
            return counts
        room += 1


def clocks(program, folder, expected):
    """The clock jumps back or ahead between the parts of a build."""
    counts = Counts("clock a day back, a year back, a year ahead")
    for shift in ("-1d", "-365d", "+365d"):
        trial = Trial(program, folder / f"clock{shift}", GRID, expected)
        trial.build("--shard", "0/2")
        result = trial.build(prefix=["faketime", "-f", shift])
        counts.judge(trial, result, shift)
    return counts


def directories(program, folder, expected):
    """Directories that become read-only, go away, and come back."""
    counts = Counts("read-only, lost and reappearing directories")
    for what in ("ro", "gone", "moved"):
        trial = Trial(program, folder / what, SLOW, expected)
        disk = trial.folder / "out"
        mounted(disk, "size=100m")
        process = trial.start("--threads", "1")
        while not list(trial.out.glob(".splitsnow-jobs/*")):
            time.sleep(0.001)
        if what == "ro":
            # no file may be open for writing
            process.kill()
            process.wait()
            subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        elif what == "gone":
            subprocess.run(["umount", "--lazy", disk], check=True)
        else:
            (disk / "g").rename(disk / "aside")
        code = process.wait()
        if what == "ro":
            refused = trial.build()
            assert refused.returncode == 1 and refused.stderr.startswith("error: "), refused
            subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
        elif what == "gone":
            mounted_again = subprocess.run(["mount", "-t", "tmpfs", "splitsnow", disk])
            assert mounted_again.returncode == 0
        elif (disk / "aside").exists():
            # what a process wrote meanwhile under the old name gives way
            shutil.rmtree(disk / "g", ignore_errors=True)
            (disk / "aside").rename(disk / "g")
        counts.judge(trial, trial.build(), f"{what} (build ended with {code})")
        subprocess.run(["umount", disk], check=True)
    return counts


def users(program, folder, expected):
    """A second user without permission."""
    counts = Counts("a second user without permission")
    trial = Trial(program, folder / "user", GRID, expected)
    trial.build("--shard", "0/2")
    # that user can read everything
    os.chmod(folder.parent, 0o755)
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    refused = trial.build(prefix=nobody)
    assert refused.returncode == 1 and refused.stderr.startswith("error: "), refused
    counts.judge(trial, trial.build(), "build")
    return counts


def stops(program, folder, expected):
    """A stopped process keeps its lock; others are told, and it goes on."""
    counts = Counts("SIGSTOP for ten seconds, with others at the door")
    trial = Trial(program, folder / "stop", SLOW, expected)
    process = trial.start("--threads", "1")
    while not (trial.out / "database.zarr").exists():
        time.sleep(0.01)
    process.send_signal(signal.SIGSTOP)
    end = time.monotonic() + 10
    while time.monotonic() < end:
        for words in ([], ["--shard", "0/2"]):
            refused = trial.build(*words)
            assert refused.returncode == 1 and "another splitsnow process" in refused.stderr, refused
        time.sleep(0.5)
    process.send_signal(signal.SIGCONT)
    assert process.wait() == 0
    counts.judge(trial, trial.build(), "build")
    return counts


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    program = str(Path(arguments.program).resolve())
    rng = random.Random(arguments.seed)
    times = lambda number: max(1, round(arguments.share * number))
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        expected = []
        for name, grid in (("expected", GRID), ("expected-slow", SLOW), ("expected-tables", TABLES)):
            trial = Trial(program, folder / name, grid)
            result = trial.build()
            assert result.returncode == 0, result
            expected.append(trial.out)
        fast, slow, tables = expected
        parts = [
            lambda: kills(program, folder / "kills", slow, rng, times(200)),
            lambda: damage(program, folder / "damage", fast, tables, rng, times(1000)),
            lambda: full_disk(program, folder / "disks", slow),
            lambda: full_inodes(program, folder / "inodes", fast),
            lambda: clocks(program, folder / "clocks", fast),
            lambda: directories(program, folder / "directories", slow),
            lambda: users(program, folder / "users", fast),
            lambda: stops(program, folder / "stops", slow),
        ]
        print("| fault | tried | repaired or unharmed | refused with a message | silent losses |")
        print("|---|---|---|---|---|", flush=True)
        lost = 0
        for part in parts:
            counts = part()
            print(counts.line(), flush=True)
            for what in counts.lost:
                print(f"lost: {counts.kind}: {what}", file=sys.stderr)
            lost += len(counts.lost)
    sys.exit(lost > 0)


main()
