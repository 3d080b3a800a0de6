"""orthoscope beside what a user would pick instead, measured in one run on the same data.

    python -m benchmarks                 everything; writes RESULTS.md and results.json beside this file
    python -m benchmarks solving points  these parts only; the others keep the figures they had

Each part is a function that returns a `Part`; PARTS lists them. Every peer, this project too, runs in a
process of its own (peers.py), so that each may live in its own environment. README.md says how to install
them.
"""
