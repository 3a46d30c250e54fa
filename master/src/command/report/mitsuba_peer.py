"""Mitsuba 3's path tracer, looked at as its picture grows; started by `igi-master report --peer mitsuba`.

Writes one JSON object a line: see `igi-master report --help`. Passes are as short as looking demands;
writing pictures is off the clock.
"""

import argparse
import json
import sys
import time

parser = argparse.ArgumentParser()
for name in ("variant", "scene", "folder", "clock", "marks"):
    parser.add_argument("--" + name, required=True)
for name in ("runs", "seed", "threads"):
    parser.add_argument("--" + name, type=int, required=True)
parser.add_argument("--seconds", type=float, required=True)
parser.add_argument("--guides", action="store_true", help="write albedo and normals, too")
arguments = parser.parse_args()


def missing(what):
    sys.exit(what + ": install it with `pip install mitsuba numpy`, or name another Python with --python")


began = time.perf_counter()
try:
    import numpy
except ImportError:
    missing("this Python has no numpy")
try:
    import drjit
    import mitsuba
except ImportError as error:
    missing(f"this Python has no Mitsuba 3 ({error})")
mitsuba.set_variant(arguments.variant)
drjit.set_thread_count(arguments.threads)
scene = mitsuba.load_file(arguments.scene)
integrator = scene.integrator()
channels = ["R", "G", "B"]
if arguments.guides:
    integrator = mitsuba.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "image": integrator})
    channels += ["albedo." + name for name in "RGB"] + ["normal." + name for name in "XYZ"]


def render(samples, seed):
    """Mean radiance of so many samples a pixel."""
    picture = mitsuba.render(scene, integrator=integrator, spp=samples, seed=seed & 0xFFFFFFFF)
    return numpy.array(picture, dtype=numpy.float64)


def say(**fields):
    print(json.dumps(fields), flush=True)


# The first picture builds trees and compiles kernels; it is nobody's run.
render(1, 0xFFFFFFFF)
say(prepared=time.perf_counter() - began, version=f"mitsuba {mitsuba.__version__} {arguments.variant} path")

marks = [float(mark) for mark in arguments.marks.split(",") if mark]
for run in range(arguments.runs):
    total, samples, wall, cpu, passes = 0.0, 0, 0.0, 0.0, 0
    next_power, to_come = 1, list(marks)
    while True:
        clock = wall if arguments.clock == "wall" else cpu / arguments.threads
        if samples and clock >= arguments.seconds:
            break
        # As many samples as fit before the next look, by the rate so far; no pass longer than half a second.
        count = max(1, next_power - samples)
        if samples:
            until = min([arguments.seconds, clock + 0.5] + to_come)
            count = max(1, min(count, int(samples / clock * (until - clock))))
        wall_before, cpu_before = time.perf_counter(), time.process_time()
        picture = render(count, ((arguments.seed + run) * 100003 + passes) * 2654435761)
        total = total + picture * count
        wall += time.perf_counter() - wall_before
        cpu += time.process_time() - cpu_before
        samples += count
        passes += 1

        clock = wall if arguments.clock == "wall" else cpu / arguments.threads
        passed = [mark for mark in to_come if mark <= clock]
        to_come = [mark for mark in to_come if mark > clock]
        if samples == next_power or passed:
            path = f"{arguments.folder}/{run}-{samples}.exr"
            # Writing waits for a second thread, for ever where there is none.
            drjit.set_thread_count(max(2, arguments.threads))
            mean = (total / samples).astype(numpy.float32)
            mitsuba.Bitmap(mean, channel_names=channels).write(path)
            drjit.set_thread_count(arguments.threads)
            say(run=run, samples=samples, seconds=wall, cpu_seconds=cpu, picture=path)
        else:
            say(run=run, share=clock / arguments.seconds)
        if samples == next_power:
            next_power *= 2
