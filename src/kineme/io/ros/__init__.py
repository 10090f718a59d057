"""ROS bags, read without ROS: which topics there are, messages as rows of numbers, and transforms between frames."""
