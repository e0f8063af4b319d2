"""Facts about tasks as data, and the pages that are made of them."""
