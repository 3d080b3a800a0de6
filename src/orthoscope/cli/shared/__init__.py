"""What verbs share: options, inputs, workers, progress, what is printed, how a verb leaves."""
