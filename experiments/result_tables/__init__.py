"""Tables of results in the pages of docs/, from the files of the benchmark and the evaluation."""
