"""What a run leaves on disk: states for ParaView, history, summary, checkpoint, pictures.

Every module here is a leaf: it takes plain arrays, numbers and paths, and knows neither the
mechanics nor the series.  Import the module that is needed, when it is needed.
"""
