"""A mass lowered onto a moving plane by a growing force (§3.2 of the 2010 paper).

It touches at t = 1 s and is then dragged along at 0.29 m/s; Coulomb's law says 0.3 m/s.
"""

from anmstrip.paper.cases import CaseReport, run_case


def main() -> CaseReport:
    """Run the case with the paper's scheme."""
    report = run_case("moving-plane", order=19, tolerance=1e-4)
    assert abs(report.rows[-1, 3] - 0.29) < 0.005
    return report


if __name__ == "__main__":
    print(main())
