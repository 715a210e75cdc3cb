#!/bin/sh
# A method that is a shell script over the EuRoC layout: the self-motion integrated at the times of the frames, by awk.
#   hippodrome eval my-town.yaml      # with this in my-town.yaml:
#     methods:
#       awk: {command: "examples/methods/euroc.sh {sequence} {out}", input: euroc}
sequence=$1
out=$2
awk -F, '
  FILENAME ~ /data.csv$/ { if ($1 !~ /^#/) frame[sprintf("%.6f", $1 / 1e9)] = 1; next }
  /^#/ { next }
  {
    dt = $1 - before; before = $1
    heading += $3 * dt
    x += $2 * dt * cos(heading); y += $2 * dt * sin(heading)
    if (sprintf("%.6f", $1) in frame)
      printf "%.9f %.9f %.9f 0 0 0 %.9f %.9f\n", $1, x, y, sin(heading / 2), cos(heading / 2)
  }
' "$sequence/mav0/cam0/data.csv" "$sequence/odometry.csv" > "$out/trajectory.tum"
