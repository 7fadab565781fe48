"""The method: from quadrature to azimuth, each step written once, for a scientist to read.

Read `quadrature`, `legendre` and `delta_m` for what is solved; `layer` for one homogeneous layer
without eigenvalues, `bordered` for the sun and the views as nodes of weight zero, `quotient` for
the one operation that all of it is made of, `doublings` for thick layers; `adding` for the stack
and its thermal light, `azimuth` for the modes, `ground` and `surface` for what lies below, and
`single_scatter` for the light that is put back exactly.
"""
