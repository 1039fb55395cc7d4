"""GRACE-FO attitude: star cameras and gyros in one filter, and what attitude does to gravity (Liang et al.).

model                       hardware, frames, scenario, tuning
truth, simulate             orbits and attitudes; what the sensors make of them
header, products, level1    Level-1 files: YAML headers, columns, records; legacy: those of GRACE
timetags, read, write       on-board to GPS time; a flight from files; files from a simulation
cameras, gyro               raw samples to combined quaternions and increments
estimate                    the multiplicative filter, its smoother, the paper's seven states
pointing, effect            angles, rates, antenna correction; accelerations and range-rates downstream
assess                      errors and consistency: where truth and estimate meet
experiment                  whole experiments over seeds and satellites
figures, gravity_figures    the paper's figures and what explains them
"""
