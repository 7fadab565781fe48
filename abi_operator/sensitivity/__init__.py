"""Studies of how a scene's image hangs on what is in it.

`nir_study` is the test of Grasso et al. (2013) on a scene: a plume's single-scattering albedo in
C03 is changed until the plume is 10 % brighter there, and darker (`ssa_for_mean`, `ssa_of_each`),
and green is derived from both, by the recipes of `products` and by a `green_table`. The command is
``abi-operator nir-test``.
"""

from .green_table import GreenTable as GreenTable
from .green_table import green_table as green_table
from .nir_study import nir_study as nir_study
from .plume_band import PlumeBand as PlumeBand
from .ssa_root import SsaRoot as SsaRoot
from .ssa_root import ssa_for_mean as ssa_for_mean
from .ssa_root import ssa_of_each as ssa_of_each
