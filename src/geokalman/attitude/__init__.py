"""GRACE-FO attitude: star cameras and gyros in one filter, and what attitude does to gravity (Liang et al.).

model        hardware, frames, scenario and tuning         truth, simulate   orbits, attitudes, sensors
products     layouts of Level-1 files                      level1, legacy    readers; write   the same files from a
simulation timetags     OBC to GPS time                               cameras, gyro     from raw samples to combined
quaternions and increments estimate     the paper's seven-state filter, the multiplicative one, the smoother
pointing     angles, rates, accelerations, antenna correction
assess       where truth and estimate meet                 campaign, flight  whole experiments
"""
