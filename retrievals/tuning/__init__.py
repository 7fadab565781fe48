"""A scene beside observations, and its plume tuned to them, as Grasso et al. (2013) tuned theirs.

`read_observed` lays what was observed on the grid of a scene; `compared` gives statistics,
histograms and maps of differences, band by band, in the plume and outside; `tuned` fits a few
numbers of the plume (`NUMBERS`), each one for all of its pixels, to the observed image, with their
errors, and tells whether the model then explains what was observed. ``abi-operator tune`` does all
of it with files.
"""

from .comparison import compare as compare
from .misfit import Misfit as Misfit
from .misfit import misfit as misfit
from .observed import read_observed as read_observed
from .plume_numbers import NUMBERS as NUMBERS
from .plume_numbers import plume_numbers as plume_numbers
from .report import report_lines as report_lines
from .study import Errors as Errors
from .study import compared as compared
from .study import numbers_of as numbers_of
from .study import tuned as tuned
