"""Live viewers: frames sent to Foxglove or Rerun during a run.

In: tracked frames with their images, and the table that makes their columns. Out: a server on this machine that viewers
connect to, and the numbers of sent and left-out frames.
"""
