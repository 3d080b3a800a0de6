"""The paper's section 4, from one command: every experiment, beside what the paper claims about it.

Part of the package, so that `orthoscope paper` runs wherever it is installed, yet using only what any user
could, the public functions of the rooms below.

    entries              who is compared: the paper's three, ours, a method of one's own
    subgrids             fewer corners of the same board
    trials               one trial: data, calibration, NCE on training and on test
    eq7_searches         eq. (7): which camera comes out for which damping and weights
    step_two             the lens from pairs by itself: degree, number of images
    times                how long it takes
    straightness         Fig. 7 as a number
    photographs          the same on real photographs
    section4             the parts, and all of them as one list of jobs
    curves               many trials to means over a level
    claims/              what the paper says, word for word; what becomes of each sentence (about_curves,
                         about_eq7, about_steps); figures and tables with theirs (in_figures, in_tables)
    first_figure         Fig. 1
    figures              NCE against noise, points, images
    page                 everything as one HTML page
    files                everything as CSV
    documents            both, ready to be written

C. Ricolfe-Viala and A. J. Sánchez-Salmerón, Using the camera pin-hole model restrictions to calibrate the
lens distortion model.
"""
