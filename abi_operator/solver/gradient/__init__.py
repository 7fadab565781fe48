"""The derivative of the method, written out: one pass up the layers, one down, for every input.

`mode` holds the derivation for one azimuth mode; `fields` the two fields that it is made of,
`layer` a layer on the way up and down, `pull_back` the parts of a layer, `room` what is kept in
between, and `mode_sum` the sum over all modes, which is what is differentiated.
"""
