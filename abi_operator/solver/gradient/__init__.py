"""The derivative of the method, written out: one pass up the layers, one down, for every input.

`mode` holds the derivation for one azimuth mode; `fields` the two fields that it is made of,
`layer` a layer on the way up and down, `stages` and `pull_back` its parts, `beams` what the beams
see of them, `room` what is kept in between, and `mode_sum` the sum over all modes, which is what is
differentiated. With thermal light, `thermal` holds the derivation and what it adds to a layer,
`emitting_mode` the passes of one mode, and `emission` the radiance; `fluxes` are its relatives.
"""
