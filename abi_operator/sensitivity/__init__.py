"""Studies of how a scene's image hangs on what is in it.

`sensitivity` takes any function of the operator's output and gives derivatives, elasticities,
finite changes and second derivatives in any `Input`: a leaf of the state (`leaf`, `factor`), one
with a short name (`declared`), or one of your own. `variance_parts` and `sampled_variance` tell
what uncertain inputs contribute, and `sensitivity_study` does all of it on the result of a
simulation (``abi-operator sensitivity``).

`nir_study` is the test of Grasso et al. (2013) on a scene: a plume's single-scattering albedo in
C03 is changed until the plume is 10 % brighter there, and darker (`ssa_for_mean`, `ssa_of_each`),
and green is derived from both, by the recipes of `products` and by a `green_table` (``abi-operator
nir-test``).

`green_figure`, `albedo_figure` and `fires_figure` draw other arguments of that paper on a scene
(``abi-operator figure``).
"""

from .declarations import aod_550 as aod_550
from .declarations import declared as declared
from .derivatives import Sensitivity as Sensitivity
from .derivatives import sensitivity as sensitivity
from .figure_albedo import albedo_figure as albedo_figure
from .figure_fires import fires_by_hour as fires_by_hour
from .figure_fires import fires_figure as fires_figure
from .figure_green import green_figure as green_figure
from .green_table import GreenTable as GreenTable
from .green_table import green_table as green_table
from .inputs import Input as Input
from .inputs import factor as factor
from .inputs import leaf as leaf
from .nir_study import nir_study as nir_study
from .outputs import output_function as output_function
from .plume_band import PlumeBand as PlumeBand
from .scene_study import Sampling as Sampling
from .scene_study import sensitivity_study as sensitivity_study
from .ssa_root import SsaRoot as SsaRoot
from .ssa_root import ssa_for_mean as ssa_for_mean
from .ssa_root import ssa_of_each as ssa_of_each
from .variance import SampledVariance as SampledVariance
from .variance import covariance_of as covariance_of
from .variance import sampled_variance as sampled_variance
from .variance import variance_parts as variance_parts
