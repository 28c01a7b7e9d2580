# SPDX-License-Identifier: MIT
"""A sweep by Snakemake and by a real Slurm on this machine, with processes killed on the way, gives what one run gives.

cluster_test.py snakemake|slurm PROGRAM SOURCE WORK
"""

import contextlib
import csv
import getpass
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

ENGINE, PROGRAM, SOURCE, WORK = sys.argv[1], sys.argv[2], Path(sys.argv[3]), Path(sys.argv[4]).resolve()
SKIPPED = 77
SHARDS, ITEMS = 3, 15
# Every item takes a while, and says in a file how often it ran. One of them is refused.
EXPERIMENT = {
    "name": "sweep",
    "sweep": {"n": list(range(ITEMS))},
    "steps": [{"name": "s", "tool": "sh", "run": ["-c", "echo x >> {out}/ran-{n}; sleep 3; test {n} != 4"], "file_sizes": {"bytes": "{out}/ran-{n}"}}],
}


def wait_for(condition, seconds, what):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.1)
    sys.exit(f"{what}: not within {seconds} s")


def items_done():
    return len(list((WORK / "results/sweep/items").glob("*.json")))


def pids_of(name):
    """Processes of this test, which has its folder or its program in their command lines."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
            here = os.readlink(folder / "cwd")
        except OSError:
            continue
        if words and Path(os.fsdecode(words[0])).name == name and (here == str(WORK) or str(WORK).encode() in b" ".join(words)):
            found.append(int(folder.name))
    return found


def kill_a_worker():
    killed = []

    def has_killed():  # a worker may end while it is looked for
        for pid in pids_of("skeletex")[:1]:
            try:
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
            except ProcessLookupError:
                pass
        return killed

    wait_for(has_killed, 30, "a worker to kill")


def kill_all_workers():
    """Until none has been seen for a second: a shell that lived on may just be about to start one."""
    last_seen = time.monotonic()
    while time.monotonic() < last_seen + 1:
        for pid in pids_of("skeletex"):
            last_seen = time.monotonic()
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.05)


def rows(folder):
    with open(folder / "results.csv") as file:
        return [{key: value for key, value in row.items() if key not in ("seconds", "peak_memory_mb")} for row in csv.DictReader(file)]


def check():
    expected = [{"model": "", "n": str(n), "status": "failed" if n == 4 else "done", "outcome": "refused" if n == 4 else "success",
                 "reason": "exit code 1" if n == 4 else ""} for n in range(ITEMS)]
    assert rows(WORK / "results/sweep") == expected, rows(WORK / "results/sweep")
    record = json.loads((WORK / "results/sweep/record.json").read_text())
    assert record["items"]["done"] == ITEMS - 1 and record["items"]["failed"] == 1 and len(record["shards"]) == SHARDS, record
    logs = {path.stem for path in (WORK / "results/sweep/items").glob("*.log")}
    assert logs == {str(n) for n in range(ITEMS)}, logs
    runs = [len((WORK / f"results/sweep/ran-{n}").read_text().split()) for n in range(ITEMS)]
    # What was done before the kill has not run again: at most one item of each shard was under way, and the refused one is tried again.
    assert sum(runs) <= ITEMS + 2 * SHARDS + 4, runs
    table = subprocess.run(["/usr/bin/python3", SOURCE / "paper_figures/outcomes.py", WORK / "results/sweep"], capture_output=True, text=True, check=True).stdout
    assert f"| all | {ITEMS} | {ITEMS - 1} ({100 * (ITEMS - 1) / ITEMS:.1f} %) | 0 | 0 | 1 | 0 | 0 |" in table and "refused: 4: exit code 1" in table, table
    assert (WORK / "results/sweep/outcomes.png").stat().st_size > 5000
    print(f"{ENGINE}: items ran {runs} times")


def test_snakemake():
    if not shutil.which("snakemake"):
        sys.exit(SKIPPED)
    command = ["snakemake", "-s", SOURCE / "experiments/cluster/Snakefile", "--cores", "2", "--rerun-incomplete", "--nolock", "--config",
               "experiment=sweep.json", f"shards={SHARDS}", f"program={PROGRAM}"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(WORK / "cache"), "HOME": str(WORK)}
    with open(WORK / "snakemake.log", "w") as log:
        first = subprocess.Popen(command, cwd=WORK, stdout=log, stderr=log, env=environment)
        wait_for(lambda: items_done() >= 1 and pids_of("skeletex"), 120, "the first item")
        kill_a_worker()  # its shard is tried again
        wait_for(lambda: items_done() >= 3, 60, "the third item")
        first.kill()  # the whole
        first.wait()
        kill_all_workers()
        assert not (WORK / "results/sweep/results.json").exists()
        second = subprocess.run(command, cwd=WORK, stdout=log, stderr=log, env=environment, timeout=120)
    if second.returncode != 0:
        for file in [WORK / "snakemake.log", *(WORK / "results/sweep/logs").glob("*.log")]:
            print(f"--- {file}", file.read_text(), sep="\n")
        sys.exit("the second call of Snakemake failed")
    check()


class Slurm:
    """munged, slurmctld and slurmd with their state in a temporary folder."""

    def __init__(self):
        self.folder = WORK / "slurm"
        for name in ("state", "spool", "munge"):
            (self.folder / name).mkdir(parents=True)
        # munged wants folders that nobody else may write to, down from the root; the test's may lie elsewhere.
        self.munge = Path("/run") / f"skeletex-munge-{os.getpid()}" if os.getuid() == 0 else self.folder / "munge"
        self.munge.mkdir(mode=0o755, exist_ok=True)
        host = socket.gethostname().split(".")[0]
        ports = []
        for _ in range(2):
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                ports.append(free.getsockname()[1])
        (self.folder / "slurm.conf").write_text(f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={self.munge}/socket
CryptoType=crypto/munge
SlurmUser={getpass.getuser()}
SlurmdUser={getpass.getuser()}
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/spool
SlurmctldPidFile={self.folder}/slurmctld.pid
SlurmdPidFile={self.folder}/slurmd.pid
SlurmctldLogFile={self.folder}/slurmctld.log
SlurmdLogFile={self.folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=test Nodes={host} Default=YES MaxTime=INFINITE State=UP
""")
        (self.folder / "cgroup.conf").write_text("CgroupAutomount=no\n")
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf"), "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin", "HOME": str(WORK)}
        self.processes = {}

    def start(self, name, *command):
        log = open(self.folder / f"{name}.out", "a")
        self.processes[name] = subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log, env=self.environment)

    def start_controller(self):
        self.start("slurmctld", "slurmctld", "-D")

    def run(self, *command):
        return subprocess.run(command, cwd=WORK, capture_output=True, text=True, env=self.environment, timeout=60)

    def start_all(self):
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        self.start("munged", "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.munge}/socket", f"--pid-file={self.munge}/munged.pid",
                   f"--seed-file={self.munge}/seed", f"--log-file={self.munge}/munged.log")
        wait_for(lambda: (self.munge / "socket").exists(), 20, "munged")
        self.start_controller()
        self.start("slurmd", "slurmd", "-D")
        wait_for(lambda: "idle" in self.run("sinfo", "-h", "-o", "%T").stdout, 60, "a node of Slurm; see " + str(self.folder))

    def has_jobs(self):
        answer = self.run("squeue", "-h")
        return answer.returncode != 0 or answer.stdout.strip() != ""

    def stop(self):
        for process in reversed(self.processes.values()):
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
        if self.munge != self.folder / "munge":
            shutil.rmtree(self.munge, ignore_errors=True)


def test_slurm():
    if not shutil.which("slurmctld", path=os.environ["PATH"] + ":/usr/sbin"):
        sys.exit(SKIPPED)
    slurm = Slurm()
    submit = ["sbatch", f"--array=1-{SHARDS}", str(SOURCE / "experiments/cluster/sweep.sbatch"), "sweep.json"]
    slurm.environment["SKELETEX"] = PROGRAM
    try:
        slurm.start_all()
        answer = slurm.run(*submit)
        assert answer.returncode == 0, answer.stderr
        wait_for(lambda: pids_of("skeletex"), 120, "a worker; see " + str(WORK))
        time.sleep(7)  # the controller saves within 5 s that the jobs run, and they take 15 s
        wait_for(lambda: items_done() >= 1, 60, "the first item")
        kill_a_worker()  # its shard is tried again
        slurm.processes["slurmctld"].kill()  # the controller: the jobs go on, and it finds them again
        slurm.processes["slurmctld"].wait()
        slurm.start_controller()
        done = items_done()
        wait_for(lambda: items_done() >= done + 2, 60, "two more items")
        job = re.search(r"\d+", answer.stdout).group()
        slurm.run("scancel", "--signal=KILL", "--full", job)  # the whole: every script and what it has started
        slurm.run("scancel", "--user", getpass.getuser())
        wait_for(lambda: not slurm.has_jobs(), 90, "the end of the killed jobs")
        assert not (WORK / "results/sweep/results.json").exists()
        answer = slurm.run(*submit)  # the same command again
        assert answer.returncode == 0, answer.stderr
        wait_for(lambda: (WORK / "results/sweep/results.json").exists(), 120, "the joined results; see " + str(WORK))
        wait_for(lambda: not slurm.has_jobs(), 60, "the end of the jobs")
    finally:
        slurm.stop()
    check()


shutil.rmtree(WORK, ignore_errors=True)
WORK.mkdir(parents=True)
(WORK / "sweep.json").write_text(json.dumps(EXPERIMENT))
{"snakemake": test_snakemake, "slurm": test_slurm}[ENGINE]()
