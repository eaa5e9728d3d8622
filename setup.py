"""Builds the Python module by CMake, for `pip install .`; the libraries that it needs are Debian's
(scripts/install-dependencies). CADMORPH_BUILD_FOLDER names a build folder to go on with."""

import os
import re
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent
SETTINGS = {
    "CMAKE_BUILD_TYPE": "Release",
    "CADMORPH_BUILD_BENCHMARKS": "OFF",
    "CADMORPH_BUILD_TESTS": "OFF",
    "Python_EXECUTABLE": sys.executable,
}


class CmakeBuild(build_ext):
    def run(self):
        folder = os.environ.get("CADMORPH_BUILD_FOLDER")
        if not folder:
            folder = self.build_temp
            settings = [f"-D{name}={value}" for name, value in SETTINGS.items()]
            subprocess.run(["cmake", "-S", ROOT, "-B", folder, *settings], check=True)
        subprocess.run(["cmake", "--build", folder, "--parallel", "--target", "cadmorph_python"], check=True)
        target = Path(self.get_ext_fullpath("cadmorph._native")).parent
        self.mkpath(str(target))
        for file in sorted((Path(folder) / "apps/python/cadmorph").iterdir()):
            if file.is_file():
                self.copy_file(str(file), str(target / file.name))


setup(
    name="cadmorph",
    version=re.search(r"project\(cadmorph VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())[1],
    description="Moves a simulation mesh onto a changed CAD model",
    license="BSD-3-Clause",
    python_requires=">=3.9",
    install_requires=["numpy"],
    packages=[],
    ext_modules=[Extension("cadmorph._native", sources=[])],
    cmdclass={"build_ext": CmakeBuild},
    options={"egg_info": {"egg_base": "build-pip"}, "build": {"build_base": "build-pip"}},
)
