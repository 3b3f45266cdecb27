# SPDX-License-Identifier: Apache-2.0
"""Simulate a drive, run two settings on it, compare their errors and write a report."""

from pathlib import Path

from locfuse.config.load import parse_config
from locfuse.report.report import write_report
from locfuse.run.run import load_log, run

floor = {
    "duration_s": 30,
    "ranges": {"rate_hz": 5, "sigma_m": 0.1},
    "faults": [{"kind": "nlos", "walls": [[4, 2, 4, 8]], "extra_m": 1.0}],
}
for noise in ("gaussian", "one_sided"):
    config = parse_config({"simulation": floor, "seed": 1, "start": "auto",
                           "estimator": {"range": {"noise": noise}}})  # fmt: skip
    log = load_log(config, None, config.seed)
    result = run(config, log)
    print(f"{noise}: {result.metrics['position_rmse_m']:.3f} m RMSE, "
          f"{result.metrics['counts']['ranges']}")  # fmt: skip
    write_report(result, Path("out/example") / noise)
print("report: out/example/one_sided/report.html")
