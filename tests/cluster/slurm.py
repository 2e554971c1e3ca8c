"""Builds on a real Slurm of two nodes on this host: a task killed, a node lost, a time limit, a
task submitted again. The files must be those of one process.

    python3 tests/cluster/slurm.py target/release/splitsnow

Needs root and Debian's slurmctld, slurmd, slurm-client and munge. Takes about two minutes.
"""

import filecmp
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

GRID = Path(__file__).parents[1] / "data" / "jobs.toml"
# so many that a task lasts some seconds
RAYS = ("rays = 20000", "rays = 200000")
TASKS = 8
PATIENCE = 600


def run(*words, **options):
    """The output of a command that must succeed."""
    done = subprocess.run(words, capture_output=True, text=True, **options)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def wait(what, condition):
    """Waits until `condition` gives something, and returns it."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.1)
    sys.exit(f"waited {PATIENCE} s for: {what}\n{subprocess.getoutput('squeue; sinfo -Nel')}")


def restart(task):
    """Starts a task that Slurm has queued again: by itself, it waits for two minutes."""
    queued = lambda: "Restarts=1" in run("scontrol", "show", "job", task)
    wait(f"{task} queued again", queued)
    subprocess.run(["scontrol", "update", f"JobId={task}", "StartTime=now"], capture_output=True)


class Cluster:
    """Slurm and its nodes n1 and n2, with all state in a folder."""

    def __init__(self, folder):
        self.folder = folder
        self.config = folder / "slurm.conf"
        self.daemons = {}
        for name in ("state", "spool.n1", "spool.n2", "log", "munge"):
            (folder / name).mkdir(parents=True)
        host, ports = socket.gethostname().split(".")[0], [17101, 17111, 17112]
        nodes = "".join(
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory=4000\n"
            for node, port in zip(("n1", "n2"), ports[1:])
        )
        self.config.write_text(
            f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool.%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.%n.pid
SlurmctldLogFile={folder}/log/slurmctld
SlurmdLogFile={folder}/log/%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=bf_interval=2,sched_interval=2,batch_sched_delay=1,requeue_delay=2
AccountingStorageType=accounting_storage/none
KillWait=5
MinJobAge=3600
SlurmdTimeout=10
ReturnToService=2
MaxArraySize=64
{nodes}PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""
        )
        key = folder / "munge" / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        (folder / "munge").chmod(0o700)
        os.environ["SLURM_CONF"] = str(self.config)
        self.start(
            "munged",
            "--foreground",
            "--force",
            f"--key-file={key}",
            f"--socket={folder}/munge/socket",
            f"--pid-file={folder}/munge/pid",
            f"--log-file={folder}/log/munge",
            f"--seed-file={folder}/munge/seed",
        )
        wait("munge", (folder / "munge" / "socket").exists)
        self.start("slurmctld", "-D", "-f", self.config)
        for node in ("n1", "n2"):
            self.start_node(node)
        wait("two idle nodes", lambda: run("sinfo", "-hN", "-o", "%T").split() == ["idle"] * 2)

    def start(self, *words, name=None):
        log = open(self.folder / "log" / "daemons", "ab")
        process = subprocess.Popen(words, stdout=log, stderr=log)
        self.daemons[name or words[0]] = process

    def start_node(self, node):
        self.start("slurmd", "-D", "-N", node, "-f", self.config, name=node)

    def lose(self, node, process):
        """A node that fails: neither its daemon nor its task says a word."""
        self.daemons.pop(node).kill()
        parents = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    stat = (entry / "stat").read_text()
                except OSError:
                    continue
                parents[int(entry.name)] = int(stat.rpartition(")")[2].split()[1])
        # the build, its script and the daemon of the step
        family = [process]
        while "slurmstepd" not in Path(f"/proc/{family[-1]}/comm").read_text():
            family.append(parents[family[-1]])
        for member in reversed(family):
            os.kill(member, signal.SIGKILL)

    def stop(self):
        for name in ("n1", "n2", "slurmctld", "munged"):
            if name in self.daemons:
                self.daemons[name].kill()
                self.daemons[name].wait()


def main():
    program = str(Path(sys.argv[1]).resolve())
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "g.toml").write_text(GRID.read_text().replace(*RAYS))
        cluster = Cluster(folder / "slurm")
        try:
            check(program, folder, cluster)
        finally:
            subprocess.run(["scancel", "--full", "--user=root"], capture_output=True)
            time.sleep(1)
            cluster.stop()
    print("the files of the cluster are those of one process")


def check(program, folder, cluster):
    out = folder / "out" / "g"
    splitsnow = lambda *words: run(program, *words, cwd=folder)
    splitsnow("build", "g.toml", "--out", "expected")

    refused = subprocess.run(
        [program, "submit", "g.toml", "--tasks", "65"], cwd=folder, capture_output=True, text=True
    )
    assert refused.returncode == 1 and "only 24 jobs" in refused.stderr, refused.stderr
    printed = splitsnow("submit", "g.toml", "--tasks", str(TASKS), "--seconds", "1", "--print")
    assert "#SBATCH --array=0-7\n" in printed and not out.exists(), printed
    said = splitsnow("submit", "g.toml", "--tasks", str(TASKS), "--seconds", "1", "--memory", "500")
    array, finisher = re.search(r"array (\d+): 8 tasks.*\njob (\d+):", said).groups()

    def status():
        if not (out / "database.zarr" / "zarr.json").exists():
            return {}
        processes = json.loads(splitsnow("status", "out/g", "--json"))["processes"]
        return {int(p["shard"].split("/")[0]): p for p in processes if p["shard"]}

    def running(shard):
        process = status().get(shard, {})
        return process if process.get("state") == "running" else None

    # task 0 is killed: it fails and is not queued again
    os.kill(wait("task 0", lambda: running(0))["process"], signal.SIGKILL)
    # task 2 is asked to end, as before a time limit: it is queued again
    wait("task 2", lambda: running(2))
    # While Slurm starts a task it refuses and passes the signal on all the same; scancel tries for
    # a minute more, which is not waited for.
    ask = subprocess.Popen(["scancel", "--batch", "--signal=USR1", f"{array}_2"], stderr=subprocess.DEVNULL)
    wait("task 2 stopped", lambda: status()[2]["state"] in ("stopped", "finished"))
    ask.kill()
    ask.wait()
    # a node is lost: its task is queued again
    nodes = lambda: dict(
        line.split()[::-1] for line in run("squeue", "-hr", "-j", array, "-t", "R", "-o", "%K %N").splitlines()
    )
    lost = wait("a task on n2", lambda: running(int(nodes().get("n2", -1))))
    cluster.lose("n2", lost["process"])
    wait("the lost node", lambda: "n2 down" in run("sinfo", "-hN", "-o", "%N %T"))
    cluster.start_node("n2")
    for shard in (2, lost["shard"].split("/")[0]):
        restart(f"{array}_{shard}")

    # the second job names the missing task, and does not simulate
    log = out / "slurm-logs" / f"{finisher}.log"
    text = lambda: log.read_text() if log.exists() else ""
    wait("the job that compresses", lambda: "error: " in text() or "components" in text())
    message = re.search(
        r"error: (\d+) of 24 jobs are missing, in the shards 0 of 8; nothing was simulated; to go on: (.*)", text()
    )
    assert message and int(message[1]) <= 3, text()
    assert not (out / "snow.safetensors").exists()
    states = {shard: process["state"] for shard, process in status().items()}
    assert states == {0: "killed"} | {shard: "finished" for shard in range(1, TASKS)}, states

    # the command that it gives submits the task again
    again = run("bash", "-c", message[2], cwd=folder).split()[-1]
    last = run("sbatch", "--parsable", f"--dependency=afterany:{again}", out / "slurm-compress.sh").strip()
    wait("the compact file", lambda: (out / "snow.safetensors").exists())
    wait("the last job", lambda: last not in run("squeue", "-h", "-o", "%A").split())
    requeued = run("scontrol", "show", "job", f"{array}_2")
    assert "Restarts=1" in requeued, requeued

    files = lambda root: {
        path.relative_to(root)
        for path in root.rglob("*")
        if path.is_file() and (path.name == "snow.safetensors" or "database.zarr" in path.parts)
    }
    expected = folder / "expected"
    assert files(expected) == files(out), files(expected) ^ files(out)
    different = [name for name in files(out) if not filecmp.cmp(expected / name, out / name, False)]
    assert not different, different


main()
