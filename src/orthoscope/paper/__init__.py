"""The paper's section 4, from one command: every experiment, beside what the paper claims about it.

part of the package, so that `orthoscope paper` runs wherever it is installed, yet
using only what any user could, the public functions of the rooms below.

    entries    who is compared
    subgrids      fewer corners of the same board
    trials        one trial: data, calibration, NCE on training and on test views
    members       eq. (7): which camera comes out for which damping
    photographs   the same on real photographs
    section4      all of it as one list of jobs
    curves        many trials to means over a level
    claims        what a claim is; claims_about_curves, claims_about_eq7: the paper's claims, judged; wording:
    their words
    figures_with_claims      figures and tables with their claims
    figures       NCE against noise, points, images
    page          everything as one HTML page
    files         everything as CSV
    documents     both, ready to be written

C. Ricolfe-Viala and A. J. Sánchez-Salmerón, Using the camera pin-hole model restrictions to calibrate the
lens distortion model.
"""
