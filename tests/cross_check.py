#!/usr/bin/env python3
"""Renders a scene of ours with Mitsuba 3, so that anyone can repeat the cross-check.

    pip install mitsuba numpy
    igi-master reference scenes/veach_door -o ours.exr --size 80x60 --samples 2048
    python tests/cross_check.py scenes/veach_door -o mitsuba.exr --spp 256 --runs 8 --size 80x60 --against ours.exr

The scene is exported by `igi-master export SCENE --mitsuba DIR` (from target/release, or IGI_MASTER).
Several runs are independent, and their mean is saved; how they differ tells the mean's noise. With --against, that
noise and the variance which `igi-master reference` keeps are what the two pictures may differ by: the ratio of their
means, the root mean square of z over pixels and channels (1 if all is well; up to 1.1 for eight runs, which know their
own noise only roughly) and the largest z, beside what chance allows (Šidák, 1 %).
--shift D moves the whole scene and its camera by D along x, y and z before Mitsuba draws it: nothing may depend on that,
but Mitsuba starts rays off a surface by 9e-5 (1 + largest coordinate), so light gets past what is nearer.
Variant scalar_rgb runs everywhere; llvm_ad_rgb needs libllvm (DRJIT_LIBLLVM_PATH names it)."""
import argparse
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scene")
parser.add_argument("-o", "--output", default="mitsuba.exr")
parser.add_argument("--spp", type=int, default=64, help="samples a pixel in each run")
parser.add_argument("--runs", type=int, default=1, help="independent runs")
parser.add_argument("--against", help="what igi-master reference has saved, of the same scene and size; needs --runs")
parser.add_argument("--size", help="WxH; default: the scene's")
parser.add_argument("--shift", type=float, default=0, metavar="D", help="move everything by D along all axes, for Mitsuba")
parser.add_argument("--time", default="0", help="moment of an animated scene")
parser.add_argument("--seed", type=int, default=0, help="of the first run")
parser.add_argument("--variant", default="scalar_rgb")
args = parser.parse_args()
if args.runs < 1 or (args.against and args.runs < 2):
    sys.exit("--runs: one picture has no variance; eight have, for --against")

try:
    import mitsuba
    import numpy
except ImportError:
    sys.exit("Mitsuba is not installed: pip install mitsuba numpy")


def layers(path):
    """Mean and variance of it, as igi-master reference saves them."""
    found = {name: numpy.array(bitmap) for name, bitmap in mitsuba.Bitmap(path).split()}
    if "variance" not in found:
        sys.exit(f"{path}: has no variance: it has to come from `igi-master reference`")
    return found["<root>"].astype(float)[..., :3], found["variance"].astype(float)[..., :3]


def shifted(xml, by):
    """The scene with everything moved: each shape, and the camera after it looks where it should."""
    move = f'<translate x="{by}" y="{by}" z="{by}"/>'
    shape = '<shape type="ply">'
    xml = xml.replace(shape, f'{shape}<transform name="to_world">{move}</transform>')
    return re.sub(r"(<lookat[^>]*/>)", lambda look: look.group(1) + move, xml, count=1)


root = pathlib.Path(__file__).resolve().parent.parent
master = os.environ.get("IGI_MASTER", str(root / "target/release/igi-master"))
with tempfile.TemporaryDirectory() as folder:
    size = ["--size", args.size] if args.size else []
    try:
        subprocess.run([master, "export", args.scene, "--mitsuba", folder, "--time", args.time, *size], check=True)
    except FileNotFoundError:
        sys.exit(f"{master}: is not there: cargo build --release, or name it with IGI_MASTER")
    mitsuba.set_variant(args.variant)
    exported = pathlib.Path(folder) / "scene.xml"
    if args.shift:
        if re.search('<emitter type="(point|spot)"', exported.read_text()):
            sys.exit("--shift: is only for scenes that surfaces, the sky or the sun light")
        exported.write_text(shifted(exported.read_text(), args.shift))
    scene = mitsuba.load_file(str(exported))
    begun, cpu = time.perf_counter(), time.process_time()
    runs = [numpy.array(mitsuba.render(scene, spp=args.spp, seed=args.seed + i)).astype(float) for i in range(args.runs)]
    seconds, cpu = time.perf_counter() - begun, time.process_time() - cpu
mean = numpy.mean(runs, axis=0)
mitsuba.Bitmap(mean.astype(numpy.float32)).write(args.output)
samples = mean.shape[0] * mean.shape[1] * args.spp * args.runs
noise = f" +- {numpy.std([run.mean() for run in runs], ddof=1) / args.runs ** 0.5:.6f}" if args.runs > 1 else ""
print(f"{args.output}: mean {mean.mean():.6f}{noise}")
print(f"{args.output}: {samples / seconds / 1e6:.3f} million samples/s of wall time, {samples / cpu / 1e6:.3f} of CPU time")

if args.against:
    ours, variance = layers(args.against)
    if ours.shape != mean.shape:
        sys.exit(f"{args.against}: is {ours.shape[1]}x{ours.shape[0]}, Mitsuba's picture {mean.shape[1]}x{mean.shape[0]}")
    # Lamps that are seen directly have no noise, but colours that are rounded somewhere.
    rounding = 1e-4 * mean
    both = variance + numpy.var(runs, axis=0, ddof=1) / args.runs + rounding * rounding
    known = both > 0
    z = (ours - mean)[known] / numpy.sqrt(both[known])
    # Noise is the same light in all channels, so channels count as one.
    error = numpy.sqrt(both.mean(axis=2).sum()) / (mean.shape[0] * mean.shape[1] * mean.mean())
    most = statistics.NormalDist().inv_cdf(1 - (1 - 0.99 ** (1 / z.size)) / 2)
    print(f"ours / Mitsuba's: {ours.mean() / mean.mean():.4f} +- {error:.4f}")
    print(f"z over {z.size} values: rms {numpy.sqrt((z * z).mean()):.3f}, largest {numpy.abs(z).max():.1f} (chance allows {most:.1f})")
