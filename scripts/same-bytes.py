#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Encodes standard models and compares the bytes with tests/hashes/encode.json: with all threads, with one, and without the fused operations of
this processor in the C library. With --cpu on other processors instead, which qemu-x86_64 (package qemu-user) emulates.

    scripts/same-bytes.py PROGRAM [--models bear,..] [--methods vsm,..] [--renew]
    scripts/same-bytes.py PROGRAM --cpu Nehalem,SandyBridge,Haswell --models bear

A processor's first model takes some minutes, as PoCL compiles its kernels under qemu; each further one 15 s. Its kernels are kept in a folder of
their own in POCL_CACHE_DIR. --renew writes the hashes: only when a change of results is meant. Ends with 1 and names each model that differs.
"""
import argparse
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parent.parent
HASHES = SOURCE / "tests/hashes/encode.json"
MODELS = ["bear", "bull", "cactus", "cow", "eight_theta", "triceratops_17"]
METHODS = ["vsm", "spd", "hybrid"]
SIZE = 64
NO_FUSED = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}


def machines(arguments):
    """Name, words before the command, and environment of each."""
    if not arguments.cpu:
        one = ["taskset", "--cpu-list", str(min(os.sched_getaffinity(0)))]
        return [("all threads", [], {}), ("one thread", one, {"POCL_MAX_PTHREAD_COUNT": "1"}), ("C library without fused operations", [], NO_FUSED)]
    if not shutil.which("qemu-x86_64"):
        sys.exit("same-bytes: --cpu needs qemu-x86_64; install the package qemu-user")
    cache = pathlib.Path(os.environ.get("POCL_CACHE_DIR", pathlib.Path.home() / ".cache/pocl"))
    caches = {cpu: cache / f"cpu-{cpu}" for cpu in arguments.cpu.split(",")}
    for folder in caches.values():
        folder.mkdir(parents=True, exist_ok=True)
    return [(cpu, ["qemu-x86_64", "-cpu", cpu], {"POCL_CACHE_DIR": str(folder)}) for cpu, folder in caches.items()]


def encode(program, model, method, before, environment, folder):
    """SHA-256 of the model file."""
    config = SOURCE / "configs/models" / f"{model}.json"
    paths = json.loads(config.read_text())
    mesh, skeleton = (config.parent / paths[key] for key in ("mesh", "skeleton"))
    output = folder / "model.skx.exr"
    command = [*before, program, "encode", mesh, skeleton, "-o", output, "--size", str(SIZE), "--method", method]
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"same-bytes: {' '.join(map(str, command))} ends with {done.returncode}:\n{done.stderr[-2000:]}")
    return hashlib.sha256(output.read_bytes()).hexdigest()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="skeletex")
    parser.add_argument("--models", default=",".join(MODELS), help="standard models (default: %(default)s)")
    parser.add_argument("--methods", default=",".join(METHODS), help="(default: %(default)s)")
    parser.add_argument("--cpu", help="names of `qemu-x86_64 -cpu help`")
    parser.add_argument("--renew", action="store_true", help="write tests/hashes/encode.json")
    arguments = parser.parse_args()
    hashes = {} if arguments.renew else json.loads(HASHES.read_text())
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for machine, before, environment in machines(arguments):
            for key in (f"{model} {method}" for model in arguments.models.split(",") for method in arguments.methods.split(",")):
                found = encode(arguments.program, *key.split(), before, environment, pathlib.Path(folder))
                wanted = hashes.setdefault(key, found) if arguments.renew else hashes.get(key)
                if found != wanted:
                    print(f"{machine}: {key}: {found}, not {wanted}", flush=True)
                    wrong += 1
            print(f"{machine}: done", flush=True)
    if arguments.renew and not wrong:
        HASHES.write_text(json.dumps(hashes, indent=2) + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
