"""A mass lowered onto a turning circle (§3.3 of the 2010 paper).

At t = 1.8 s friction can no longer hold it; it snaps round the circle and comes back to
x = 0 below it, up to 0.036 m that the regularised friction holds without contact.
"""

from anmstrip.paper.cases import CaseReport, run_case


def main() -> CaseReport:
    """Run the case with the paper's scheme."""
    report = run_case("rotating-circle", order=19, tolerance=1e-4)
    ux, uy = report.end
    assert abs(ux) < 0.036
    assert uy < -2.0
    return report


if __name__ == "__main__":
    print(main())
