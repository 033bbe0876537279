"""What reads the lessons' material: questions, exercises and their checking, the glossary, the rules of a lesson."""
