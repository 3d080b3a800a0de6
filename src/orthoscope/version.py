"""The version, which every file that orthoscope writes names."""

__version__ = "0.1.0"
