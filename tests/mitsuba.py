#!/usr/bin/env python3
"""Renders a scene of ours with Mitsuba 3, so that anyone can repeat the cross-check.

    pip install mitsuba
    python tests/mitsuba.py scenes/cornell -o mitsuba.exr --spp 256 --size 80x80
    igi-master reference scenes/cornell -o ours.exr --size 80x80 --samples 256
    igi-master compare ours.exr mitsuba.exr

The scene is exported by `igi-master export SCENE --mitsuba DIR` (from target/release, or IGI_MASTER).
Variant scalar_rgb runs everywhere; llvm_ad_rgb needs libllvm (DRJIT_LIBLLVM_PATH names it)."""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import time

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scene")
parser.add_argument("-o", "--output", default="mitsuba.exr")
parser.add_argument("--spp", type=int, default=64, help="samples a pixel")
parser.add_argument("--size", help="WxH; default: the scene's")
parser.add_argument("--time", default="0", help="moment of an animated scene")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--variant", default="scalar_rgb")
args = parser.parse_args()

try:
    import mitsuba
except ImportError:
    sys.exit("Mitsuba is not installed: pip install mitsuba")

root = pathlib.Path(__file__).resolve().parent.parent
master = os.environ.get("IGI_MASTER", str(root / "target/release/igi-master"))
with tempfile.TemporaryDirectory() as folder:
    size = ["--size", args.size] if args.size else []
    try:
        subprocess.run([master, "export", args.scene, "--mitsuba", folder, "--time", args.time, *size], check=True)
    except FileNotFoundError:
        sys.exit(f"{master}: is not there: cargo build --release, or name it with IGI_MASTER")
    mitsuba.set_variant(args.variant)
    scene = mitsuba.load_file(str(pathlib.Path(folder) / "scene.xml"))
    begun, cpu = time.perf_counter(), time.process_time()
    image = mitsuba.render(scene, spp=args.spp, seed=args.seed)
    bitmap = mitsuba.Bitmap(image)
    seconds, cpu = time.perf_counter() - begun, time.process_time() - cpu
bitmap.write(args.output)
samples = bitmap.size()[0] * bitmap.size()[1] * args.spp
print(f"{args.output}: {samples / seconds / 1e6:.3f} million samples/s of wall time, {samples / cpu / 1e6:.3f} of CPU time")
