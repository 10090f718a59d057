"""Recognition of movements: classifiers, open set, early recognition, spotting."""
