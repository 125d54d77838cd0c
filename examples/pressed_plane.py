"""A mass pressed on a moving plane with a given force (§3.1 of the 2010 paper).

Friction drags the mass along until the spring balances it: u = 0.298585 m.
"""

from anmstrip.paper.cases import CaseReport, run_case


def main() -> CaseReport:
    """Run the case with the paper's scheme."""
    report = run_case("pressed-plane", order=19, tolerance=1e-4)
    assert abs(report.end[0] - 0.298585) < 1e-4
    return report


if __name__ == "__main__":
    print(main())
