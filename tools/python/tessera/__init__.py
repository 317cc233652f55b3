"""Tessera from Python: 3D scans of any size to triangle meshes, out of core.

Meshes are two arrays: vertices, float64 of shape (n, 3), and faces, whole numbers of shape (m, 3), counter-clockwise from outside; so they
go to and from other packages as they are:

    trimesh.Trimesh(V, F)                                        V, F = mesh.vertices, mesh.faces
    open3d.geometry.TriangleMesh(Vector3dVector(V), Vector3iVector(F.astype(np.int32)))
    pyvista.PolyData.from_regular_faces(V, F)                    V, F = mesh.points, mesh.regular_faces

Jobs do what the commands of the same name do, with the same bytes, whether they get arrays or files. Every option of a command is a
keyword, dashes as underscores (`feature_angle=30`); `memory="2G"`, `threads=4`, `temp=...` say how it runs. A job stops at Ctrl-C with
KeyboardInterrupt, and on files the same call goes on where it stopped. `progress` is called with a dictionary: stage, stage_index, stages,
unit, done, total, seconds, stage_done. Reports are dictionaries, as `OUT.report.json` has them.
"""

from __future__ import annotations

import atexit
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Callable, Iterator, Optional, Sequence, Union

import numpy as np


def _require_processor(cpuinfo: str = "/proc/cpuinfo") -> None:
    # An illegal instruction would take the interpreter with it.
    if Path(__file__).with_name("portable").exists() or not os.path.exists(cpuinfo):
        return
    flags = next((line.split() for line in Path(cpuinfo).read_text().splitlines() if line.startswith("flags")), [])
    lacking = [name for name in ("avx2", "fma", "bmi2") if flags and name not in flags]
    if lacking:
        raise ImportError(f"this processor lacks {', '.join(lacking).upper()}, which tessera is compiled for: build the module "
                          "for any processor, pip install . -C portable=yes, which is many times slower")


_require_processor()
from . import _tessera
from ._tessera import (
    EmptyError,
    Error,
    InputError,
    ResourceError,
    StoppedError,
    UsageError,
    ValidationError,
    __version__,
)

__all__ = [
    "EmptyError", "Error", "InputError", "ResourceError", "StoppedError", "UsageError", "ValidationError",
    "check", "closest_points", "command", "decimate", "fill_holes", "read_mesh", "read_mesh_faces",
    "read_mesh_vertices", "read_points", "reconstruct", "remesh", "run", "smooth", "winding_number", "write_mesh",
]

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[dict], Any]
Report = dict

_JOBS = ("decimate", "field", "merge", "reconstruct", "remesh", "resample", "resurface", "smooth")
_CLASSES = {c.code: c for c in (UsageError, InputError, ResourceError, EmptyError, ValidationError, StoppedError)}


def _paths(inputs: Union[PathLike, Sequence[PathLike]]) -> list[str]:
    if isinstance(inputs, (str, os.PathLike)):
        inputs = [inputs]
    return [os.fspath(i) for i in inputs]


def _keys(options: dict) -> dict:
    return {k.replace("_", "-"): os.fspath(v) if isinstance(v, os.PathLike) else v for k, v in options.items()}


def run(job: str, inputs: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
        progress: Optional[Progress] = None, **options: Any) -> Report:
    """Runs a job on files and returns its report.

    `job` is decimate, field, merge, reconstruct, remesh, resample, resurface or smooth, in this process; any other command is run by
    the program (`command`). Inputs are files, folders, globs or @lists.
    """
    if job not in _JOBS:
        command(job, *_paths(inputs), out=output, **options)
        report = Path(os.fspath(options.get("report", os.fspath(output).rstrip("/") + ".report.json")))
        return json.loads(report.read_text()) if report.exists() else {}
    return json.loads(_tessera.run_job(job, _paths(inputs), os.fspath(output), json.dumps(_keys(options)), progress))


def reconstruct(scans: Union[PathLike, Sequence[PathLike]], output: PathLike, *,
                progress: Optional[Progress] = None, **options: Any) -> Report:
    """Scans become a mesh: `reconstruct("flight/*.laz", "site.ply", tolerance="auto", memory="4G")`."""
    return run("reconstruct", scans, output, progress=progress, **options)


def _on_arrays(job: str, vertices: Any, faces: Any, progress: Optional[Progress],
               options: dict) -> tuple[np.ndarray, np.ndarray, Report]:
    made_vertices, made_faces, report = _tessera.run_on_arrays(job, vertices, np.asarray(faces), json.dumps(_keys(options)),
                                                               progress)
    return made_vertices, made_faces, json.loads(report)


def decimate(vertices: Any, faces: Any, *, progress: Optional[Progress] = None,
             **options: Any) -> tuple[np.ndarray, np.ndarray, Report]:
    """Shrinks a mesh within a tolerance that is proven both ways: `V, F, report = decimate(V, F, tolerance=0.01)`.

    Arrays of float64, and of 32 or 64 bits, in rows are read where they are, without a copy; what is made of them has the positions,
    faces and order that the program makes of the same mesh in a file. Memory beside what is returned stays under the cap, scratch files
    lie in `temp`, else in the system's folder. `run("decimate", "in.ply", "out.ply", ...)` does it on files.
    """
    return _on_arrays("decimate", vertices, faces, progress, options)


def remesh(vertices: Any, faces: Any, *, progress: Optional[Progress] = None,
           **options: Any) -> tuple[np.ndarray, np.ndarray, Report]:
    """Triangles near equilateral with edges of one length: `V, F, report = remesh(V, F, edge=0.5, tolerance=0.05)`."""
    return _on_arrays("remesh", vertices, faces, progress, options)


def smooth(vertices: Any, faces: Any, *, progress: Optional[Progress] = None,
           **options: Any) -> tuple[np.ndarray, np.ndarray, Report]:
    """Smooths; creases, corners and borders keep their shape: `V, F, report = smooth(V, F, method="denoise")`."""
    return _on_arrays("smooth", vertices, faces, progress, options)


def fill_holes(vertices: Any, faces: Any, *, max_edges: int = 1000) -> tuple[np.ndarray, np.ndarray, Report]:
    """Closes boundary loops of up to `max_edges` edges by smooth patches; the outer border of an open piece stays.

    New vertices and faces come last. The report counts loops by what became of them. The mesh must be a manifold with border.
    """
    return _tessera.fill_holes(vertices, faces, max_edges)


def winding_number(vertices: Any, faces: Any, points: Any) -> np.ndarray:
    """Generalized winding numbers at points (q, 3): about 1 inside, 0 outside, off by less than 0.005. Any soup of triangles will do."""
    return _tessera.winding_number(vertices, faces, points)


def closest_points(vertices: Any, faces: Any, points: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The closest points of a mesh to points (q, 3): their positions (q, 3), faces (q,) and distances (q,)."""
    return _tessera.closest_points(vertices, faces, points)


def check(mesh: PathLike, *, reference: PathLike = "", tolerance: float = 0.0, crossings: bool = False,
          memory: int = 0, threads: int = 0, temp: PathLike = "") -> Report:
    """What is true of a mesh file: topology, orientation, shape; against a reference whether both stay within a tolerance.

    `report["deviation"]["complaint"]` then says in a sentence what is beyond it; empty: nothing, proven.
    """
    return json.loads(_tessera.check(os.fspath(mesh), crossings, os.fspath(reference), tolerance, memory, threads,
                                     os.fspath(temp)))


def read_mesh(path: PathLike, *, colours: bool = False):
    """Vertices (n, 3) float64 and faces (m, 3) uint64 of a PLY, OBJ, STL, OFF or GLB; with `colours` rgba (n, 4) uint8 or None, too."""
    vertices, faces, rgba = _tessera.read_mesh(os.fspath(path))
    return (vertices, faces, rgba) if colours else (vertices, faces)


def read_mesh_vertices(path: PathLike, chunk: int = 1 << 20) -> Iterator[np.ndarray]:
    """The vertices of a mesh of any size, `chunk` at a time: arrays (k, 3) of float64."""
    return _tessera.MeshIterator(os.fspath(path), _chunk(chunk), False)


def read_mesh_faces(path: PathLike, chunk: int = 1 << 20) -> Iterator[np.ndarray]:
    """The faces of a mesh of any size, `chunk` at a time: arrays (k, 3) of uint64."""
    return _tessera.MeshIterator(os.fspath(path), _chunk(chunk), True)


def write_mesh(path: PathLike, vertices: Any, faces: Any, *, rgba: Any = None) -> None:
    """Writes PLY, OBJ, STL or GLB, by the name. Positions are stored as floats where that loses nothing."""
    _tessera.write_mesh(os.fspath(path), vertices, np.asarray(faces), rgba)


def read_points(inputs: Union[PathLike, Sequence[PathLike]], chunk: int = 1 << 20) -> Iterator[dict]:
    """The points of scans of any size, `chunk` at a time, two chunks in memory: dictionaries of arrays.

    position (k, 3) float64, and where the files have them normal (k, 3) float32, rgba (k, 4) uint8, intensity uint16, classification,
    return_number and returns uint8. PLY, LAS, LAZ, COPC, E57, PCD, PTX, PTS, XYZ and CSV; folders, globs and @lists too.
    """
    return _tessera.PointIterator(_paths(inputs), _chunk(chunk))


def _chunk(chunk: int) -> int:
    if chunk < 1:
        raise UsageError(f"chunk: {chunk} is not a number of elements above 0")
    return chunk


def command(name: str, *inputs: PathLike, **options: Any) -> str:
    """Runs any command of the program `tessera` (TESSERA_PROGRAM, or on the PATH), and returns what it printed.

    Lists give an option once for each element, True a flag. Failures are raised as the class of the exit code.
    """
    program = os.environ.get("TESSERA_PROGRAM") or shutil.which("tessera")
    if not program:
        raise UsageError("the program tessera is not on the PATH: install the package, or name it in TESSERA_PROGRAM")
    words = [program, name, *map(os.fspath, inputs)]
    for key, value in _keys(options).items():
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if one is True:
                words.append("--" + key)
            elif one is not False and one is not None:
                words += ["--" + key, os.fspath(one) if isinstance(one, os.PathLike) else str(one)]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        said, wrong = child.communicate()
    except KeyboardInterrupt:
        child.terminate()
        child.wait()
        raise
    if child.returncode == 0:
        return said
    lines = [line for line in wrong.splitlines() if line.startswith("tessera: error: ")]
    message = lines[-1][len("tessera: error: "):] if lines else wrong.strip()
    raise _CLASSES.get(child.returncode, Error)(message)


@atexit.register
def _leave() -> None:
    # A factorisation that was cancelled runs on: nothing may be destroyed under it.
    if _tessera.work_left_behind():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(130)
