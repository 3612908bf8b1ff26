"""The field's other measures: of beats against music (`beats`), of motion alone (`quality`), of sets (`frechet`)."""
