"""The camera suite: a pattern's picture as a camera makes it, stage by stage, with known marker positions.

``parts`` holds the parameters of the stages, ``effects`` grades and draws them, ``shoot`` makes the picture.
"""
