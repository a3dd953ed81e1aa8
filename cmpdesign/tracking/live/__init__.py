"""Live viewers: frames sent to Foxglove or Rerun while a run goes on.

In: tracked frames with their images, and the table that makes their columns. Out: a server on this machine that viewers
connect to, the number of frames that it sent, and of those that it left out.
"""
