"""What the machine and its installation give: cores, threads of BLAS, packages that may be missing."""
