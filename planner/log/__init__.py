"""Motion logs and their JSON form."""
