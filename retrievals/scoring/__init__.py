"""How good a retrieval is, judged by the truth that was specified.

`score_retrieval` compares a retrieval with the result it was made from, in all and by bins, and
`format_report` prints that; `score` is the arithmetic on two arrays, `detection` that on a score
and what it tells of. `pictures` needs matplotlib and is imported by its name.
"""

from .detection import Detection as Detection
from .detection import detection as detection
from .metrics import Score as Score
from .metrics import binned_scores as binned_scores
from .metrics import score as score
from .report import format_report as format_report
from .report import score_retrieval as score_retrieval
