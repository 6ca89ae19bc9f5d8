"""Converts the folder fruta1 of the public repository fsousa96/image_processing to a recording.

    python3 fruta1.py image_processing/fruta1 recording        # needs scipy, numpy, pillow

Colour PNGs are copied. Depth (MATLAB files, millimetres) becomes 16-bit PNG. recording.toml is
fruta1.toml beside this file.
"""

import pathlib
import shutil
import sys

import numpy
import scipy.io
from PIL import Image

source, target = map(pathlib.Path, sys.argv[1:3])
for folder in ("color", "depth"):
    (target / folder).mkdir(parents=True, exist_ok=True)
for file in sorted(source.glob("rgb_image1_*.png")):
    shutil.copy(file, target / "color" / (file.stem.split("_")[-1] + ".png"))
for file in sorted(source.glob("depth1_*.mat")):
    depth = scipy.io.loadmat(file)["depth_array"].astype(numpy.uint16)
    Image.fromarray(depth).save(target / "depth" / (file.stem.split("_")[-1] + ".png"))
shutil.copy(pathlib.Path(__file__).with_name("fruta1.toml"), target / "recording.toml")
