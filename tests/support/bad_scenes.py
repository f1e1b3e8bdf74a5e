"""A scene with no more than it needs, and changes of one that are refused."""


MINIMAL = """
[simulation]
duration = 300.0
macro_step = 0.1
[start]
x = 800.0
[environment]
[pipe]
length = 1200.0
"""

BAD_CHANGES = {
    "unknown section": ("simulaton.duration=1", "simulaton = ", "did you mean simulation?"),
    "unknown key": ("simulation.duraton=1", "simulation.duraton = 1", "did you mean duration?"),
    "not a number": ('simulation.duration="long"', "simulation.duration = 'long'", "must be a number"),
    "a truth value for a number": ("simulation.duration=true", "simulation.duration = True", "must be a number"),
    "not finite": ("simulation.duration=nan", "simulation.duration = nan", "must be finite"),
    "infinite": ("start.x=inf", "start.x = inf", "must be finite"),
    "negative": ("simulation.duration=-5", "simulation.duration = -5", "must be > 0 s"),
    "zero step": ("simulation.macro_step=0", "simulation.macro_step = 0", "must be > 0 s"),
    "step beyond the end": ("simulation.macro_step=400", "macro_step = 400", "must be <= duration"),
    "not a list": ("simulation.snapshots=30", "simulation.snapshots = 30", "must be a list"),
    "unknown scheme": ('coupling.scheme="jacobi"', "coupling.scheme = 'jacobi'", "must be one of"),
    "loose tolerance": ("coupling.tolerance=2", "coupling.tolerance = 2", "must be < 1"),
    "degrees for radians": ("start.departure=67.4", "start.departure = 67.4", "must be <= 3.14"),
    "a number for a table": ("pipe.length.x=1", "pipe.length = 1200.0", "no table"),
    "a value for a section": ("pipe=1", "pipe = 1", "must be a table"),
    "height of a floating vessel": ("start.z=-800", "start.z = -800", "must be absent"),
    "motion of a vessel's pipe": ("top_motion={amplitude=[0,0,1],period=9}", "top_motion", "must be absent"),
    "short vector": ("tables.environment=[{time=0,force=[1,2]}]", "environment[1].force", "must have 3 values"),
    "table out of order": ("tables.environment=[{time=5},{time=2}]", "environment[2].time = 2", "must be > 5 s"),
    "empty table": ("tables.environment=[]", "tables.environment = []", "at least one row"),
    "text without quotes": ("pipe.top=pinned", "pipe.top=pinned", "in quotes"),
    "no value": ("pipe.top", "--set pipe.top", "must be key=value"),
}
