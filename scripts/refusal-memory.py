#!/usr/bin/env python3
"""How much memory gpbrdf-cli takes while it refuses damaged files: python3 scripts/refusal-memory.py GPBRDF_CLI

Writes a whole file of each kind, damages copies of it in three ways, and prints a table in Markdown: the size of the
file and the largest peak of resident memory beyond that of `--version` (GNU time). It ends with exit code 1 where a
copy is accepted, where a message has more than one line, or where the memory exceeds the size of the file by 64 MiB.
"""

import base64
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

MIB = 2**20
SPARE = 64 * MIB


def run(arguments, folder):
    """Exit code, standard error and peak of resident memory in bytes of a command."""
    peak = folder / "peak"
    timed = ["/usr/bin/time", "--quiet", "-f", "%M", "-o", str(peak), *arguments]
    ended = subprocess.run(timed, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    return ended.returncode, ended.stderr, 1024 * int(peak.read_text().split()[-1])


def glb():
    corners = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    buffer = "data:application/octet-stream;base64," + base64.b64encode(corners).decode()
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": buffer}],
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<5I", 2, 20 + len(text), len(text), 0x4E4F534A, 0)[:12] + b"JSON" + text


def rows(header, row, count):
    return (header + "\n" + (row + "\n") * count).encode()


def whole_files(program, folder):
    """Name, content and the command that refuses it where the file is called FILE."""
    write = [
        (["convert", "phong", "table.binary"], "table.binary", ["info", "FILE"]),
        (["convert", "phong", "table.exr"], "table.exr", ["info", "FILE"]),
        (["convert", "phong", "rgl.bsdf"], "rgl.bsdf", ["info", "FILE"]),
        (["convert", "phong", "zemax.bsdf", "--format", "zemax"], "zemax.bsdf", ["info", "FILE"]),
        (["convert", "phong", "samples.csv", "--samples", "100000"], "samples.csv", ["info", "FILE"]),
        (["fit", "phong", "-o", "model.safetensors"], "model.safetensors", ["info", "FILE"]),
        (["render", "phong", "-o", "map.exr", "--spp", "1", "--size", "1024x512"], "map.exr",
         ["eval", "phong", "ward", "--env", "FILE"]),
    ]
    for arguments, name, refuse in write:
        ended = subprocess.run([program, "-q", *arguments], cwd=folder, capture_output=True, text=True)
        if ended.returncode != 0:
            sys.exit(f"gpbrdf-cli {' '.join(arguments)}: {ended.stderr}")
        yield name, (folder / name).read_bytes(), refuse
    sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1024 +X 2048\n" + bytes([9, 8, 7, 130]) * (1024 * 2048)
    yield "map.hdr", sky, ["eval", "phong", "ward", "--env", "FILE"]
    square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1"
    yield "mesh.obj", rows("o squares", square, 50000), ["render", "phong", "--scene", "FILE", "-o", "x.png"]
    yield "mesh.glb", glb(), ["render", "phong", "--scene", "FILE", "-o", "x.png"]
    directions = rows("theta_h,theta_d,phi_d", "10,20,30", 100000)
    yield "directions.csv", directions, ["predict", "model.safetensors", "FILE"]


def damaged(name, content):
    """Copies that no reader may accept: cut off, with a large word in the header, with foreign bytes in the middle."""
    middle = len(content) // 2
    yield content[: middle - 1]
    yield content[:middle] + b"\xff\xfe\x00 1e400 nan\x00" * 16 + content[middle + 224 :]
    for at in (0, 8, 18, 28):
        yield content[:at] + b"\xff\xff\xff\x7f\xff\xff\xff\x7f" + content[at + 8 :]


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    # Without it a library of the graphics driver complains on standard error.
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        _, _, base = run([program, "--version"], folder)
        print(f"| file | MiB | refused copies | MiB to refuse, beyond the {base / MIB:.1f} of `--version` |")
        print("|---|---|---|---|")
        for name, content, refuse in whole_files(program, folder):
            most, count = 0, 0
            file = f"damaged-{name}"
            for copy in damaged(name, content):
                (folder / file).write_bytes(copy)
                code, said, peak = run([program, *[file if a == "FILE" else a for a in refuse]], folder)
                if code == 0:
                    # Text holds no sizes that could be wrong; a copy may be as good as the file.
                    continue
                if code != 1 or said.count("\n") != 1 or not said.startswith("error: "):
                    wrong.append(f"{name}: exit code {code}, {said!r}")
                most, count = max(most, peak - base), count + 1
            print(f"| `{name}` | {len(content) / MIB:.1f} | {count} | {most / MIB:.1f} |")
            if count == 0:
                wrong.append(f"{name}: every copy is accepted")
            if most > len(content) + SPARE:
                wrong.append(f"{name}: {most} bytes for a file of {len(content)}")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
