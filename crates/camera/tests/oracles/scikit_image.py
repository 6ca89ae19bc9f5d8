"""Metrics by scikit-image: python scikit_image.py FOLDER WIDTH HEIGHT.

Reads FOLDER/a and FOLDER/b (8-bit RGB), written by the test. Writes FOLDER/out (float64): the mean
SSIM, the PSNR and the SSIM map (mean over the channels).
"""

import sys
import numpy as np
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

folder, width, height = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
a, b = (np.fromfile(f"{folder}/{name}", np.uint8).reshape(height, width, 3).astype(float) for name in "ab")
# The settings of Wang et al., according to the documentation of structural_similarity.
mean, full = structural_similarity(
    a, b, data_range=255.0, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
)
psnr = peak_signal_noise_ratio(a, b, data_range=255.0)
np.concatenate([[mean, psnr], full.mean(axis=2).ravel()]).astype(float).tofile(f"{folder}/out")
