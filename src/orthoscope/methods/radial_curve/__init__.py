"""Lenses that are radial about a centre and nothing else, from planar grids (Hartley and Kang;
Fitzgibbon).
"""
