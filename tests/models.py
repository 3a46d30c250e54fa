#!/usr/bin/env python3
"""What share of public model files opens: fetches the repositories of tests/models/list.txt, draws each model small, counts.

    python3 tests/models.py --into /tmp/models [--mirror DIR] [--igi target/release/igi-master] [--only WORD]

Writes /tmp/models/report.txt (a line a file: what became of it, seconds, the first line of an error), and contact sheets
sheet-NN.png to look at if Pillow is installed: opening is counted, looking right is for eyes. --mirror names a folder of bare
repositories OWNER+NAME/repo to take instead of cloning. A model counts as open if a picture is drawn that is not of one colour.
"""

import argparse
import os
import subprocess
import sys
import time

KINDS = (".obj", ".gltf", ".glb")
HERE = os.path.dirname(os.path.abspath(__file__))


def listed():
    """Repositories with folders, and parts of paths to leave out."""
    wanted, left_out = [], []
    with open(os.path.join(HERE, "models", "list.txt"), encoding="utf-8") as lines:
        for line in (line.split("#")[0].split() for line in lines):
            if line[:1] == ["!"]:
                left_out.append(line[1])
            elif line:
                wanted.append((line[0], line[1] if len(line) > 1 else ""))
    return wanted, left_out


def fetch(repository, folder, into, mirror):
    """The folder of a repository on this disk, or None if it cannot be had."""
    there = os.path.join(into, repository.replace("/", "+"))
    place = os.path.join(there, folder)
    if os.path.isdir(place) and os.listdir(place):
        return place
    os.makedirs(there, exist_ok=True)
    if mirror:
        bare = os.path.join(mirror, repository.replace("/", "+"), "repo")
        bare = os.path.join(bare, ".git") if os.path.isdir(os.path.join(bare, ".git")) else bare
        if not os.path.isdir(bare):
            return None
        unpack(bare, folder, there)
    else:
        url = f"https://github.com/{repository}"
        subprocess.run(["git", "clone", "--quiet", "--depth", "1", url, there], check=False)
    return place if os.path.isdir(place) else None


def unpack(bare, folder, there):
    """Writes the files of a bare repository that it holds: large ones may be missing from a copy."""
    listing = subprocess.run(
        ["git", "-C", bare, "ls-tree", "-r", "-z", "HEAD", *([folder] if folder else [])], capture_output=True, check=True
    )
    reader = subprocess.Popen(
        ["git", "-C", bare, "cat-file", "--batch"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    for line in listing.stdout.split(b"\0")[:-1]:
        about, path = line.split(b"\t", 1)
        reader.stdin.write(about.split()[2] + b"\n")
        reader.stdin.flush()
        head = reader.stdout.readline().split()
        if head[1:2] != [b"blob"]:
            continue
        content = reader.stdout.read(int(head[2]) + 1)[:-1]
        place = os.path.join(os.fsencode(there), path)
        os.makedirs(os.path.dirname(place), exist_ok=True)
        with open(place, "wb") as file:
            file.write(content)
    reader.stdin.close()


def models(place):
    """Model files below a folder, by name. Of a glTF in several forms all are taken."""
    found = []
    for folder, _, names in os.walk(place):
        found += [os.path.join(folder, name) for name in names if name.lower().endswith(KINDS)]
    return sorted(path for path in found if not is_of_version_1(path))


def is_of_version_1(path):
    """glTF 1.0 is another format."""
    with open(path, "rb") as file:
        head = file.read(1 << 20)
    if head[:4] == b"glTF":
        return head[4:8] != b"\2\0\0\0"
    text = head.replace(b" ", b"").replace(b"\n", b"").replace(b"\t", b"")
    return path.lower().endswith(".gltf") and (b'"version":"1' in text or b'"version":"0' in text)


def draw(igi, path, picture):
    """What became of it: a word, seconds, a line of words."""
    begun = time.monotonic()
    command = [igi, "render", path, "-o", picture, "--size", "160x120", "--frames", "4", "--exposure", "auto"]
    try:
        run = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=300, check=False)
    except subprocess.TimeoutExpired:
        return "slow", 300.0, ""
    seconds = time.monotonic() - begun
    if run.returncode != 0 or not os.path.isfile(picture):
        words = [line for line in run.stderr.splitlines() if line.strip()]
        outcome = "crashed" if "panicked" in run.stderr else "refused"
        # A copy may lack large files that a model names: that says nothing about its reader.
        if "does not exist" in run.stderr and "holds no triangle" in run.stderr:
            outcome = "incomplete"
        return outcome, seconds, words[-1] if words else ""
    return ("drawn" if has_contrast(picture) else "empty"), seconds, ""


def has_contrast(picture):
    """Not all pixels are alike; without Pillow nobody looks."""
    try:
        from PIL import Image
    except ImportError:
        return True
    return any(low != high for low, high in Image.open(picture).convert("RGB").getextrema())


def sheets(pictures, into):
    """Contact sheets of 12 by 10."""
    try:
        from PIL import Image, ImageDraw
    except ImportError:
        return
    for first in range(0, len(pictures), 120):
        some = pictures[first : first + 120]
        sheet = Image.new("RGB", (12 * 160, -(-len(some) // 12) * 134))
        for i, (name, picture) in enumerate(some):
            at = (i % 12 * 160, i // 12 * 134)
            ImageDraw.Draw(sheet).text((at[0] + 2, at[1]), name[:26], fill=(255, 255, 0))
            if os.path.isfile(picture):
                sheet.paste(Image.open(picture).convert("RGB"), (at[0], at[1] + 14))
        sheet.save(os.path.join(into, f"sheet-{first // 120:02}.png"))


def main():
    """Fetches, draws, counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", required=True)
    parser.add_argument("--mirror")
    parser.add_argument("--igi", default="target/release/igi-master")
    parser.add_argument("--only", default="", help="paths that hold this word")
    given = parser.parse_args()
    wanted, left_out = listed()
    files = []
    for repository, folder in wanted:
        place = fetch(repository, folder, given.into, given.mirror)
        if place is None:
            print(f"{repository}: cannot be had", file=sys.stderr)
            continue
        files += [path for path in models(place) if not any(part in path for part in left_out)]
    files = [path for path in files if given.only in path]
    counts, pictures = {}, []
    os.makedirs(os.path.join(given.into, "pictures"), exist_ok=True)
    with open(os.path.join(given.into, "report.txt"), "w", encoding="utf-8") as report:
        for number, path in enumerate(files):
            picture = os.path.join(given.into, "pictures", f"{number:05}.png")
            outcome, seconds, words = draw(given.igi, path, picture)
            counts[outcome] = counts.get(outcome, 0) + 1
            pictures.append((os.path.basename(path), picture))
            report.write(f"{outcome}\t{seconds:.1f}\t{os.path.relpath(path, given.into)}\t{words}\n")
            report.flush()
    sheets(pictures, given.into)
    drawn, total = counts.get("drawn", 0), max(len(files) - counts.get("incomplete", 0), 1)
    print(f"{drawn} of {total} files that are whole are drawn: {100.0 * drawn / total:.1f} %; {counts}")


if __name__ == "__main__":
    main()
