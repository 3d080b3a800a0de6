"""The page about a calibration: its tables and figures."""
