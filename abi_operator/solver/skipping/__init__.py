"""What a column does not need, left out: by numbers that are data, one for each tile of columns.

One number from the user, the error budget, a relative error of the reflectance, decides how much of
the method is done. `budget` says how it is spent and holds every threshold; `faint` tells which
columns need no solution, as hardly anything is scattered in them, `faint_heat` what they have of
thermal light, and `one_pass` all that both hang on; `grouping` finds layers that are alike,
`merging` solves them as one and hands each its own slope, and the loops over modes, layers and
doublings end where the numbers say (`gradient.mode_sum`). Nothing of it is a property of a program:
the same program serves every scene, inside `jax.jit`, `jax.vmap` and loops too, and value and
derivative leave out the same, but that derivatives are always those of a solution.
"""
