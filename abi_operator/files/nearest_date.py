"""Which of the dates of a map of albedo a scene has."""

import numpy as np


def nearest_date(dates: np.ndarray, time: np.datetime64 | np.ndarray) -> tuple[int, float]:
    """Index of the day of `time` among dates, or else of the nearest; and how far that is. [day]

    A date of MODIS's albedo is a day, in the middle of the 16 from which it is made, and so not the
    midnight at which it begins. Of two days that are equally far the one nearer to `time` is taken.

    Parameters
    ----------
    dates
        Dates (date,), one or more.
    time
        Of the scene, UTC.
    """
    now = np.asarray(time, "datetime64[ns]")
    days = dates.astype("datetime64[D]")
    away = np.abs((days - now.astype("datetime64[D]")) / np.timedelta64(1, "D"))
    noons = days.astype("datetime64[ns]") + np.timedelta64(12, "h")
    best = int(np.lexsort((np.abs((noons - now) / np.timedelta64(1, "h")), away))[0])
    return best, float(away[best])
