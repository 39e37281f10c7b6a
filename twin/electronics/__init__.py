"""The prototype's electronics: between the law and the coils, and the joints and the law, a stage a file."""
