"""Recognizing movements: representations, averaged kernels, classifiers, answers."""
