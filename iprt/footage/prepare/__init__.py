"""From a video's files to frames; `stages` lists the stages in order."""
