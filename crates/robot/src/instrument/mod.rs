//! Laparoscopic instruments: shaft, jaw and what they weigh.
