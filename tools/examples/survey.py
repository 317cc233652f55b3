"""A survey: a LAZ of a flight becomes the bare ground as a mesh, a GeoTIFF of heights, contour lines and a glTF for the browser.

usage: survey.py SCAN.laz FOLDER        (the program tessera on the PATH, or named in TESSERA_PROGRAM)
"""

import sys
from pathlib import Path

import numpy as np

import tessera

scan, folder = Path(sys.argv[1]), Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)

# What is in the scan, a million points at a time.
count, low, high, classes = 0, np.full(3, np.inf), np.full(3, -np.inf), np.zeros(256, int)
for chunk in tessera.read_points(scan, chunk=1_000_000):
    position = chunk["position"]
    count += len(position)
    low, high = np.minimum(low, position.min(axis=0)), np.maximum(high, position.max(axis=0))
    if "classification" in chunk:
        classes += np.bincount(chunk["classification"], minlength=256)
print(f"{count} points, {np.round(high - low, 1)} wide, classes {np.flatnonzero(classes)}")

# The terrain as a mesh; the same call goes on after Ctrl-C.
ground = folder / "ground.ply"
report = tessera.reconstruct(scan, ground, surface="ground", tolerance="auto", memory="2G", force=True,
                             progress=lambda p: p["stage_done"] and print(f"  {p['stage']}: {p['done']} {p['unit']}"))
print(f"{report['mesh']['faces']} faces")

# Heights and a shaded relief as GeoTIFF, contour lines, glTF.
tessera.command("raster", ground, out=folder / "ground.tif", cell=1, layer=["ground", "hillshade"], force=True)
tessera.command("contours", ground, out=folder / "contours.gpkg", interval=1, force=True)
tessera.command("convert", ground, out=folder / "ground.glb", force=True)

# Arrays: how steep the terrain is.
vertices, faces = tessera.read_mesh(ground)
a, b, c = (vertices[faces[:, k]] for k in range(3))
normal = np.cross(b - a, c - a)
area = np.linalg.norm(normal, axis=1) / 2
steep = np.abs(normal[:, 2]) < np.cos(np.radians(30)) * 2 * area
print(f"steeper than 30 degrees: {100 * area[steep].sum() / area.sum():.1f} % of {area.sum():.0f} square units")
