"""Results of running sensors outside of the process: as messages, for viewers, in files.

In: running sensors. Out: messages on the topics of recordings, a server, an MCAP file.
"""
