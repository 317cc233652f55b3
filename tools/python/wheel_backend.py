"""Builds the wheel of the Python module with CMake: a backend of PEP 517 without dependencies.

Used by pip alone (pyproject.toml). What it builds stays in build/wheel, so the next call is quick. `-C portable=yes` makes a module for any
x86-64, without AVX2, in build/wheel-portable.
"""

import base64
import hashlib
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

TREE = Path(__file__).resolve().parents[2]


def _version() -> str:
    return re.search(r"project\(tessera VERSION ([0-9.]+)", (TREE / "CMakeLists.txt").read_text()).group(1)


def _build(portable: bool) -> Path:
    folder = TREE / "build" / ("wheel-portable" if portable else "wheel")
    subprocess.check_call([
        "cmake", "-S", str(TREE), "-B", str(folder), "-G", "Ninja", "-D", "CMAKE_BUILD_TYPE=Release", "-D", "TESSERA_UNITY=ON",
        "-D", "TESSERA_PIC=ON", "-D", "TESSERA_PROGRAM_ONLY=ON", "-D", "TESSERA_PYTHON=ON",
        "-D", f"TESSERA_PORTABLE={'ON' if portable else 'OFF'}", "-D", f"Python_EXECUTABLE={sys.executable}",
    ])
    jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL")
    subprocess.check_call(["cmake", "--build", str(folder), "--target", "tessera_python", *(["--parallel", jobs] if jobs else [])])
    return folder / "python" / "tessera"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    portable = str((config_settings or {}).get("portable", "no")).lower() in ("yes", "on", "true", "1")
    module, version = _build(portable), _version()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
    info = f"tessera-{version}.dist-info"
    files = {f"tessera/{p.name}": p.read_bytes() for p in sorted(module.iterdir()) if p.is_file()}
    files[f"{info}/METADATA"] = (
        f"Metadata-Version: 2.1\nName: tessera\nVersion: {version}\n"
        "Summary: 3D scans of any size to triangle meshes, out of core\nLicense: MIT\nRequires-Python: >=3.9\n"
        "Requires-Dist: numpy\n").encode()
    files[f"{info}/LICENSE"] = (TREE / "LICENSE").read_bytes()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: tessera\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    record = "".join(
        f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode()},{len(data)}\n"
        for name, data in files.items())
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    name = f"tessera-{version}-{tag}.whl"
    with zipfile.ZipFile(Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for file, data in files.items():
            wheel.writestr(file, data)
    return name


def build_sdist(sdist_directory, config_settings=None):
    raise SystemExit("a source distribution is a clone of the repository")
