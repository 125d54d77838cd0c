"""The three mass-spring cases of Béchet, Lejeune and Potier-Ferry (2010)."""
