"""How good a calibration is: metrics, coverage of the frame, the verdict."""
